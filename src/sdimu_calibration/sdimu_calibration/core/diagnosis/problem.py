"""Evidence with the bookkeeping of priors and odds for any set of chosen columns."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Generic

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.diagnosis.scan import Scan, alike, scan, threshold
from sdimu_calibration.core.evidence.candidate import Candidate
from sdimu_calibration.core.evidence.held_out import HeldOut, predict
from sdimu_calibration.core.evidence.linear import E

WIDE = 3.0
"""Factor on the physical prior of a candidate: a sensor may be out of its class."""
_PROVEN = 30.0
"""Factor on the physical prior of a chosen effect: its size is the data's to say, and what a prior holds back of it
looks like companions."""
_OWN_ODDS = 6.0
"""Log odds (1) that a registered effect has before an equation: physics says nothing of the equation."""
_KIN = 2.0
"""Log odds (1) of an effect that acts on one axis as one that was found acts on another: they have one cause."""


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

    @cached_property
    def kin(self) -> Ints:
        """Cause of each candidate: candidates of one effect, with the same time constant or the like, share a number.

        Returns
        -------
        ndarray of int, shape (q,)
        """
        known: dict[tuple[str, ...], int] = {}
        keys = [(c.family, *c.effect.options.values()) for c in self.evidence.candidates]
        return np.array([known.setdefault(key, len(known)) for key in keys], dtype=np.int64)

    def log_odds(self, beside: Sequence[int]) -> Floats:
        """Log odds of each candidate before the data: of registered effects, and of kin of what was chosen.

        Parameters
        ----------
        beside : sequence of int
            Columns that were chosen.

        Returns
        -------
        ndarray, shape (q,)
            Log (1).
        """
        own = np.array([c.family == "own" for c in self.evidence.candidates], dtype=bool)
        kin = np.isin(self.kin, self.kin[np.array(beside, dtype=int) - self.p]) & ~own
        return np.asarray(_KIN * kin - _OWN_ODDS * own)

    def scores(self, scanned: Scan, beside: Sequence[int] = (), ratio: float = WIDE) -> Floats:
        """Log posterior odds of every column against the model without it.

        The Bayes factor of an effect of size N(0, s^2), with information J on it and information vector d, is
        ``d^2 / (2 (J + s^-2)) - log(1 + J s^2) / 2``. To it come the odds of `log_odds`.

        Parameters
        ----------
        scanned : Scan
            Of p + q columns.
        beside : sequence of int
            Columns that were chosen: their kin have better odds.
        ratio : float
            s over the one-sigma size that physics gives the effect.

        Returns
        -------
        ndarray, shape (p + q,)
            Log odds (1); -inf for the model's columns, for what is not testable, and for a size of the wrong sign.
        """
        p = self.p
        J, d = scanned.J[p:], scanned.d[p:]
        wide = 1.0 / (ratio * self.evidence.prior) ** 2
        with np.errstate(divide="ignore", invalid="ignore"):
            occam = np.where(wide > 0.0, 0.5 * np.log1p(J / wide), 0.0)
            score = 0.5 * d**2 / (J + wide) - occam
        score = score + self.log_odds(beside)
        wrong = (d < 0.0) & np.array([c.effect.positive for c in self.evidence.candidates], dtype=bool)
        score = np.where(wrong, -np.inf, score)
        return np.concatenate([np.full(p, -np.inf), np.where(np.isfinite(scanned.sigma[p:]), score, -np.inf)])

    def held_out(self, chosen: Sequence[int]) -> HeldOut:
        """Predict each stop from the others with the chosen columns in the model."""
        known, weight, shift = self.known(chosen)
        return predict(self.evidence, known, weight, shift)


def look_alikes(problem: Problem[E], chosen: Sequence[int], column: int, allowed: Ints) -> list[int]:
    """Columns that the data cannot tell from a chosen one, all others chosen being in the model.

    Parameters
    ----------
    problem : Problem
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
    # What else was found says which is the likelier cause, not what the data tell apart.
    scores = problem.scores(problem.scan(others))
    outside = np.ones(len(scores), dtype=bool)
    outside[allowed] = False
    outside[column] = False
    scores[outside] = -np.inf
    return alike(scores, column)
