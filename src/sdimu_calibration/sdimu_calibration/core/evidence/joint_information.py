"""Information on parameters and on noise with a memory together: each judged with the other one estimated again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.evidence.information import Information, solved
from sdimu_calibration.core.evidence.learned_noise import (
    LEAST_GAIN,
    NoiseInformation,
    Wander,
    learn,
    likelihood,
    refined,
    root_of,
)
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.noise_term import NoiseTerm


@dataclass(frozen=True)
class Joint:
    """Information on parameters and wandering biases together.

    Attributes
    ----------
    evidence : LinearEvidence
        q columns.
    wander : Wander
        m signatures.
    across : ndarray, shape (n, m)
        Information across the first n columns of the evidence and the wander, where it is known.
    """

    evidence: LinearEvidence
    wander: Wander
    across: Floats

    @classmethod
    def of(cls, evidence: LinearEvidence, wander: Wander, earlier: Joint | None = None) -> Joint:
        """Put evidence and wander together; `earlier` is of the same signatures, or of the first ones of them."""
        if earlier is None:
            return cls(evidence, wander, np.zeros((0, wander.U.shape[1])))
        known = earlier.information.J[: len(earlier.evidence.names), len(earlier.evidence.names) :]
        return cls(evidence, wander, known)

    @cached_property
    def information(self) -> Information:
        """Information on the columns of the evidence, then on the wander, in white noise."""
        W, U, e = self.evidence.W, self.wander.U, self.evidence.e
        own, n = self.evidence.information, len(self.across)
        across = np.vstack([self.across, self.wander.across(W[:, n:])])
        J = np.block([[own.J, across], [across.T, self.wander.square]])
        return Information(J, np.concatenate([own.d, U.T @ e]))

    def given(self, known: Ints, weight: Floats) -> Given:
        """Estimate some parameters along with the rest.

        Parameters
        ----------
        known : ndarray of int, shape (k,)
            Columns of the parameters.
        weight : ndarray, shape (k,)
            Prior information of each (inverse square of its unit, SI).
        """
        full, q = self.information, len(self.evidence.names)
        B, d = full.J[:, known], full.d
        X = solved(B[known] + np.diag(weight), np.column_stack([B.T, d[known]]))
        left = d - B @ X[:, -1]
        J = np.diag(full.J)[:q] - np.einsum("qk,kq->q", B[:q], X[:, :q])
        J[known] = left[known] = 0.0
        across = full.J[:q, q:] - B[:q] @ X[:, q:-1]
        across[known] = 0.0
        square = full.J[q:, q:] - B[q:] @ X[:, q:-1]
        fitted = 0.5 * float(d[known] @ X[:, -1])
        noise = NoiseInformation(0.5 * (square + square.T), left[q:], fitted)
        return Given(J, left[:q], across, noise, self.wander)

    def in_noise(self, terms: Sequence[NoiseTerm]) -> Information:
        """Information on the columns of the evidence in noise of these terms."""
        q, full = len(self.evidence.names), self.information
        R = root_of(terms, self.wander.cut)
        B = full.J[:q, q:] @ R
        M = np.eye(R.shape[1]) + R.T @ full.J[q:, q:] @ R
        X = np.linalg.solve(M, np.column_stack([B.T, R.T @ full.d[q:]]))
        return Information(full.J[:q, :q] - B @ X[:, :-1], full.d[:q] - B @ X[:, -1])


@dataclass(frozen=True)
class Given:
    """Information on everything else when some parameters are in the model.

    Attributes
    ----------
    J, d : ndarray, shape (q,)
        On each column of the evidence, in white noise.
    across : ndarray, shape (q, m)
        Of the columns with the wandering biases.
    noise : NoiseInformation
        On the wandering biases.
    wander : Wander
    """

    J: Floats
    d: Floats
    across: Floats
    noise: NoiseInformation
    wander: Wander

    @property
    def fitted(self) -> float:
        """Log-likelihood that the parameters in the model add, in white noise."""
        return self.noise.fitted

    def likelihood(self, terms: Sequence[NoiseTerm]) -> float:
        """Log-likelihood of the parameters in the model and of noise terms, against neither."""
        return likelihood(self.noise, self.wander.cut, terms)

    def with_column(self, column: int, weight: float) -> NoiseInformation:
        """Information on the wander with one column more in the model, of prior information `weight`."""
        u, j, d = self.across[column], self.J[column] + weight, self.d[column]
        return NoiseInformation(
            self.noise.J - np.outer(u, u / j), self.noise.d - u * (d / j), self.fitted + 0.5 * d * d / j
        )

    def in_noise(self, terms: Sequence[NoiseTerm]) -> tuple[Floats, Floats]:
        """Information on each column, and its pull, in noise of these terms.

        Returns
        -------
        J, d : ndarray, shape (q,)
            Inverse squares of the units (SI) of the parameters; inverse units.
        """
        if not terms:
            return self.J.copy(), self.d.copy()
        R = root_of(terms, self.wander.cut)
        B = self.across @ R
        M = np.eye(R.shape[1]) + R.T @ self.noise.J @ R
        X = np.linalg.solve(M, np.column_stack([B.T, R.T @ self.noise.d]))
        return self.J - np.einsum("qr,rq->q", B, X[:, :-1]), self.d - B @ X[:, -1]


@dataclass(frozen=True)
class Balance:
    """Noise terms, and the likelihood of the model that has them.

    Attributes
    ----------
    terms : tuple of NoiseTerm
    likelihood : float
        Log-likelihood against no parameters and white noise.
    """

    terms: tuple[NoiseTerm, ...]
    likelihood: float

    @property
    def net(self) -> float:
        """Log-likelihood less what the noise terms cost."""
        return self.likelihood - LEAST_GAIN * len(self.terms)


def balance(
    information: NoiseInformation, wander: Wander, start: Sequence[NoiseTerm] = (), more: bool = True
) -> Balance:
    """Learn the noise of a model.

    Parameters
    ----------
    information : NoiseInformation
        With the parameters of the model estimated along.
    wander : Wander
    start : sequence of NoiseTerm
        Terms to begin with.
    more : bool
        Look for further terms; else only the sizes are optimised.
    """
    terms = (learn if more else refined)(information, wander.cut, start)
    return Balance(terms, likelihood(information, wander.cut, terms))
