"""Information on parameters and on noise with a memory together: each judged with the other one estimated again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.evidence.information import Information, solved
from sdimu_calibration.core.evidence.learned_noise import NoiseInformation
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.evidence.noise_root import folded, spread
from sdimu_calibration.core.evidence.taken import Taken, taken
from sdimu_calibration.core.evidence.wander import Wander
from sdimu_calibration.core.noise_term import NoiseTerm


@dataclass(frozen=True)
class Joint:
    """Information on parameters and wandering biases together."""

    evidence: LinearEvidence
    """q columns."""
    wander: Wander
    """m signatures."""
    known: Floats
    """Information across the first n columns of the evidence and the wander, where it is known, shape (n, m)."""

    @classmethod
    def of(cls, evidence: LinearEvidence, wander: Wander, earlier: Joint | None = None) -> Joint:
        """Put evidence and wander together; `earlier` is of the same signatures, or of the first ones of them."""
        if earlier is None:
            return cls(evidence, wander, np.zeros((0, wander.U.parts.shape[1])))
        return cls(evidence, wander, earlier.across)

    @cached_property
    def across(self) -> Floats:
        """Information across the q columns of the evidence and the wander in white noise.

        Returns
        -------
        ndarray, shape (q, m)
            Inverse units (SI) of both.
        """
        return np.vstack([self.known, self.wander.U.across(self.evidence.W[:, len(self.known) :])])

    @cached_property
    def pull(self) -> Floats:
        """Information vector of the wander in white noise, shape (m,); in its inverse units (SI)."""
        return np.asarray(self.wander.U.across(self.evidence.e[:, None])[0])

    def taken(self, terms: Sequence[NoiseTerm], columns: Ints | slice = slice(None)) -> Taken:
        """Work out what the modes of a noise take of the information on columns of the evidence.

        Parameters
        ----------
        columns : ndarray of int, shape (k,), optional
            Of the evidence; all of them without.
        """
        M, y, _ = folded(self.wander.U.square, self.pull, terms, self.wander.cut)
        return taken(M, y, spread(self.across[columns], terms, self.wander.cut))

    def on_wander(self, known: Ints, weight: Floats) -> NoiseInformation:
        """Information on the wandering biases with some parameters estimated along.

        Parameters
        ----------
        known : ndarray of int, shape (k,)
            Columns of the parameters.
        weight : ndarray, shape (k,)
            Prior information of each (inverse square of its unit, SI).
        """
        own = self.evidence.information
        B, d = self.across[known], own.d[known]
        X = solved(own.J[np.ix_(known, known)] + np.diag(weight), np.column_stack([B, d]))
        J = self.wander.U.square - B.T @ X[:, :-1]
        return NoiseInformation(0.5 * (J + J.T), self.pull - B.T @ X[:, -1])

    def in_noise(self, terms: Sequence[NoiseTerm]) -> Information:
        """Information on the columns of the evidence in noise of these terms."""
        own, modes = self.evidence.information, self.taken(terms)
        return Information(own.J - modes.J, own.d - modes.d)
