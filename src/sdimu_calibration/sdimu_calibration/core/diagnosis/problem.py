"""Evidence with the bookkeeping of priors and odds for any set of chosen columns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Generic

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.diagnosis.scan import Scan, alike, scan, threshold
from sdimu_calibration.core.evidence.candidate import Candidate
from sdimu_calibration.core.evidence.held_out import HeldOut, predict
from sdimu_calibration.core.evidence.linear import E
from sdimu_calibration.core.posterior.models import gains
from sdimu_calibration.core.posterior.prior import UNKNOWN_SIZE

_PROVEN = 30.0
"""Factor on the physical prior of a chosen effect: so wide that the data decide its size. What a narrow prior holds
back looks like further effects."""


class Problem(Generic[E]):
    """Evidence with the bookkeeping of priors for any set of chosen columns."""

    def __init__(self, evidence: E) -> None:
        self.evidence = evidence
        self.p = len(evidence.weight)

    def known(self, chosen: Sequence[int]) -> tuple[Ints, Floats, Floats]:
        """Parameters that are estimated when some candidates are in the model, with their priors.

        Parameters
        ----------
        chosen : sequence of int, length k
            Columns of the candidates.

        Returns
        -------
        known : ndarray of int, shape (p + k,)
            Columns of the model, then `chosen`.
        weight : ndarray, shape (p + k,)
            Prior information of each (1/sigma^2, SI); the prior of a candidate is wider by `_PROVEN`.
        shift : ndarray, shape (p + k,)
            Prior mean of each, less the calibration's value (SI).
        """
        evidence = self.evidence
        prior = evidence.prior[np.array(chosen, dtype=int) - self.p] if len(chosen) else np.empty(0)
        weight = np.concatenate([evidence.weight, 1.0 / (_PROVEN * prior) ** 2])
        shift = np.concatenate([evidence.shift, np.zeros(len(chosen))])
        return np.concatenate([evidence.model, np.array(chosen, dtype=np.int64)]).astype(np.int64), weight, shift

    def candidate(self, column: int) -> Candidate:
        """Return the candidate at a column."""
        return self.evidence.candidates[column - self.p]

    def scan(self, chosen: Sequence[int]) -> Scan:
        """Score all columns with the chosen ones in the model."""
        known, weight, _ = self.known(chosen)
        return scan(self.evidence.information, known, weight)

    def threshold(self, scanned: Scan, alpha: float) -> float:
        """Size of the largest score of a scan with nothing chosen that pure noise exceeds with probability `alpha`."""
        tested = np.flatnonzero(np.isfinite(scanned.sigma))
        return threshold(self.evidence.information, self.evidence.model, self.evidence.weight, tested, alpha)

    def scores(self, scanned: Scan) -> Floats:
        """Log Bayes factor of every column against the model without it, by the prior of the posterior.

        Parameters
        ----------
        scanned : Scan
            Of p + q columns.

        Returns
        -------
        ndarray, shape (p + q,)
            Log (1); -inf for the model's columns, for what is not testable, and for a size of the wrong sign.
        """
        evidence, p = self.evidence, self.p
        own = np.diag(evidence.information.J)[p:]
        size = np.where(np.isfinite(evidence.prior), evidence.prior, UNKNOWN_SIZE / np.sqrt(np.maximum(own, 1e-300)))
        positive = np.array([c.effect.positive for c in evidence.candidates], dtype=bool)
        by_width = gains(np.maximum(scanned.J[p:], 0.0) * size**2, scanned.d[p:] * size, positive)
        score = np.where(np.isfinite(scanned.sigma[p:]), np.logaddexp.reduce(by_width, axis=1), -np.inf)
        return np.concatenate([np.full(p, -np.inf), score])

    def held_out(self, chosen: Sequence[int]) -> HeldOut:
        """Predict each stop from the others with the chosen columns in the model."""
        known, weight, shift = self.known(chosen)
        return predict(self.evidence, known, weight, shift)


def look_alikes(problem: Problem[E], chosen: Sequence[int], column: int, allowed: Ints) -> list[int]:
    """Columns that the data cannot tell from a chosen one, all others chosen being in the model.

    Parameters
    ----------
    chosen : sequence of int
        Columns of everything that was chosen.
    column : int
        The one of them.
    allowed : ndarray of int, shape (a,)
        Columns among which they are looked for.

    Returns
    -------
    list of int
        Columns, the highest score first.
    """
    others = [c for c in chosen if c != column]
    scores = problem.scores(problem.scan(others))
    outside = np.ones(len(scores), dtype=bool)
    outside[allowed] = False
    outside[column] = False
    scores[outside] = -np.inf
    return alike(scores, column)
