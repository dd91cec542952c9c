"""Two effects at once: where they hide each other, none stands out, or a third one takes the place of both.

A step of the search adds the one effect that explains most. Where two effects nearly cancel (an anisoinertia and a
sensitivity to angular acceleration, in turns about one axis), each alone explains little, and an effect that resembles
what is left of both is chosen before them. So all pairs are tried once no single effect is left: beside what was
chosen, and in the place of each of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.diagnosis.problem import WIDE, Problem
from sdimu_calibration.core.evidence.information import Information
from sdimu_calibration.core.evidence.linear import E
from sdimu_calibration.core.evidence.testable import TESTABLE

_ALPHA = 0.02
"""Probability (1) that pure noise makes one of all pairs worth its cost: that of a whole scan of single effects. Pairs
are counted as if they were independent: 600 draws of noise for 15,568 pairs exceeded the cost in less than 1 %."""


@dataclass(frozen=True)
class PairTrial:
    """A pair beside what was chosen, or in the place of one effect of it.

    Attributes
    ----------
    others : tuple of int
        Columns of what was chosen and stays.
    pair : tuple of int, length 2
        Columns of the two.
    worth : float
        Log-likelihood (1) that it gains over what was chosen, less what two effects cost more.
    """

    others: tuple[int, ...]
    pair: tuple[int, int]
    worth: float


def best_pair(
    problem: Problem[E], chosen: Sequence[int], allowed: Ints, limit: float, scale: float = 1.0
) -> PairTrial | None:
    """Find the pair of effects that is worth most, beside what was chosen or in the place of one effect of it.

    Parameters
    ----------
    problem : Problem
    chosen : sequence of int, length k
        Columns of what was chosen.
    allowed : ndarray of int, shape (a,)
        Columns that may be chosen.
    limit : float
        Score that noise reaches in a scan of single effects (1): each of the two must reach it beside the other.
    scale : float
        Residual noise over specified noise.

    Returns
    -------
    PairTrial or None
        None where no pair is worth its cost.
    """
    pool = _physical(problem, allowed)
    trials = [_trial(problem, [c for c in chosen if c != out], out, pool, limit, scale) for out in (None, *chosen)]
    return max((t for t in trials if t is not None and t.worth > 0.0), key=lambda t: t.worth, default=None)


def _physical(problem: Problem[E], allowed: Ints) -> Ints:
    """Columns of effects that act by motion, temperature or at a constant rate of time.

    Drifts of which a scan tries many times or time constants, and faults, imitate nearly anything two at a time.
    """

    def fits(column: int) -> bool:
        candidate = problem.candidate(column)
        effect = candidate.effect
        drifts = (effect.bias_drift and bool(effect.options)) or effect.wander_like or effect.scope == "recording"
        of_known_size = bool(np.isfinite(problem.evidence.prior[column - problem.p]))
        return of_known_size and not drifts and candidate.family != "own"

    return np.array([c for c in allowed.tolist() if fits(c)], dtype=np.int64)


def _trial(
    problem: Problem[E], others: Sequence[int], out: int | None, pool: Ints, limit: float, scale: float
) -> PairTrial | None:
    """Find the likeliest pair beside others, in the place of the column `out`; None where there is none."""
    scanned = problem.scan(others, scale)
    columns = pool[np.isfinite(scanned.sigma[pool])]
    if len(columns) < 2:
        return None
    pairs = _Pairs.of(problem, others, columns, scale)
    odds = np.where(pairs.stand(limit), pairs.log_odds(problem, others), -np.inf)
    i, j = np.unravel_index(int(np.argmax(odds)), odds.shape)
    if not odds[i, j] > 0.0:
        return None
    instead = 0.0 if out is None else 0.5 * scanned.z[out] ** 2 - 0.5 * limit**2
    worth = float(pairs.gain[i, j]) - _cost(len(columns)) - instead
    return PairTrial(tuple(others), (int(columns[i]), int(columns[j])), worth)


def _cost(n: int) -> float:
    """Log-likelihood (1) that the best pair of n effects reaches in noise with a probability of `_ALPHA`."""
    return float(np.log(0.5 * n * (n - 1) / _ALPHA))


@dataclass(frozen=True)
class _Pairs:
    """All pairs of n effects beside a choice.

    Attributes
    ----------
    columns : ndarray of int, shape (n,)
    J, d : ndarray, shape (n, n) and (n,)
        Information on their sizes with the choice in the model (1/sigma^2, SI), and its information vector.
    alone : ndarray, shape (n,)
        Information on each with nothing else in the model (1/sigma^2, SI).
    positive : ndarray of bool, shape (n,)
        Effects that have one sign.
    """

    columns: Ints
    J: Floats
    d: Floats
    alone: Floats
    positive: Bools

    @classmethod
    def of(cls, problem: Problem[E], others: Sequence[int], columns: Ints, scale: float) -> _Pairs:
        """Take what the data say of columns (n,) with others in the model."""
        known, weight, _ = problem.known(others)
        full, cut = problem.evidence.information, np.concatenate([known, columns])
        given = Information(full.J[np.ix_(cut, cut)], full.d[cut]).given(np.arange(len(known)), weight)
        J, d = given.J[len(known) :, len(known) :] / scale**2, given.d[len(known) :] / scale**2
        positive = np.array([problem.candidate(c).effect.positive for c in columns.tolist()], dtype=bool)
        return cls(columns, J, d, np.diag(full.J)[columns] / scale**2, positive)

    @cached_property
    def gain(self) -> Floats:
        """Log-likelihood (1) of each pair over the choice, shape (n, n); 0 on the diagonal."""
        return _explained(np.diag(self.J), self.J, self.d)

    def stand(self, limit: float) -> Bools:
        """Whether both effects of a pair reach `limit` (sigma) beside the other, with the right sign; shape (n, n)."""
        J = np.diag(self.J)
        with np.errstate(divide="ignore", invalid="ignore"):
            # Information on the row's effect, and its score, with the column's in the model.
            left = J[:, None] - self.J**2 / J[None, :]
            z = (self.d[:, None] - self.J * (self.d / J)[None, :]) / np.sqrt(left)
            seen = np.sqrt(left / self.alone[:, None]) > TESTABLE
        fine = seen & (np.where(self.positive[:, None], z, np.abs(z)) > limit)
        return np.asarray(fine & fine.T & ~np.eye(len(J), dtype=bool))

    def log_odds(self, problem: Problem[E], others: Sequence[int]) -> Floats:
        """Log posterior odds (1) of each pair over the choice, as `Problem.scores` has them of one; shape (n, n)."""
        at = self.columns - problem.p
        wide = 1.0 / (WIDE * problem.evidence.prior[at]) ** 2
        J = np.diag(self.J) + wide
        each = problem.log_odds(others)[at] - problem.odds_against[self.columns] + 0.5 * np.log(wide)
        with np.errstate(divide="ignore", invalid="ignore"):
            det = np.log(J[:, None] * J[None, :] - self.J**2)
        return np.asarray(_explained(J, self.J, self.d) - 0.5 * det + each[:, None] + each[None, :])


def _explained(diagonal: Floats, J: Floats, d: Floats) -> Floats:
    """Half of ``d' A^-1 d`` for A of each pair, shape (n, n): A has the `diagonal` (n,), and J (n, n) beside it."""
    with np.errstate(divide="ignore", invalid="ignore"):
        det = diagonal[:, None] * diagonal[None, :] - J**2
        square = diagonal[None, :] * d[:, None] ** 2 + diagonal[:, None] * d[None, :] ** 2
        out = 0.5 * (square - 2.0 * J * d[:, None] * d[None, :]) / det
    np.fill_diagonal(out, 0.0)
    return out
