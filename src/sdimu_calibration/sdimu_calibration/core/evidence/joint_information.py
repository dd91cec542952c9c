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
from sdimu_calibration.core.evidence.taken import taken
from sdimu_calibration.core.evidence.wander import Wander
from sdimu_calibration.core.noise_term import NoiseTerm


@dataclass(frozen=True)
class Joint:
    """Information on parameters and wandering biases together."""

    evidence: LinearEvidence
    """q columns."""
    wander: Wander
    """m signatures."""
    across: Floats
    """Information across the first n columns of the evidence and the wander, where it is known, shape (n, m)."""

    @classmethod
    def of(cls, evidence: LinearEvidence, wander: Wander, earlier: Joint | None = None) -> Joint:
        """Put evidence and wander together; `earlier` is of the same signatures, or of the first ones of them."""
        if earlier is None:
            return cls(evidence, wander, np.zeros((0, wander.U.parts.shape[1])))
        known = earlier.information.J[: len(earlier.evidence.names), len(earlier.evidence.names) :]
        return cls(evidence, wander, known)

    @cached_property
    def information(self) -> Information:
        """Information on the columns of the evidence, then on the wander, in white noise."""
        W, U, e = self.evidence.W, self.wander.U, self.evidence.e
        own, n = self.evidence.information, len(self.across)
        across = np.vstack([self.across, U.across(W[:, n:])])
        J = np.block([[own.J, across], [across.T, U.square]])
        return Information(J, np.concatenate([own.d, U.across(e[:, None])[0]]))

    def on_wander(self, known: Ints, weight: Floats) -> NoiseInformation:
        """Information on the wandering biases with some parameters estimated along.

        Parameters
        ----------
        known : ndarray of int, shape (k,)
            Columns of the parameters.
        weight : ndarray, shape (k,)
            Prior information of each (inverse square of its unit, SI).
        """
        full, q = self.information, len(self.evidence.names)
        B, d = full.J[known, q:], full.d[known]
        X = solved(full.J[np.ix_(known, known)] + np.diag(weight), np.column_stack([B, d]))
        J = full.J[q:, q:] - B.T @ X[:, :-1]
        return NoiseInformation(0.5 * (J + J.T), full.d[q:] - B.T @ X[:, -1], 0.5 * float(d @ X[:, -1]))

    def in_noise(self, terms: Sequence[NoiseTerm]) -> Information:
        """Information on the columns of the evidence in noise of these terms."""
        q, full = len(self.evidence.names), self.information
        B = spread(full.J[:q, q:], terms, self.wander.cut)
        M, y, _ = folded(full.J[q:, q:], full.d[q:], terms, self.wander.cut)
        modes = taken(M, y, B)
        return Information(full.J[:q, :q] - modes.J, full.d[:q] - modes.d)
