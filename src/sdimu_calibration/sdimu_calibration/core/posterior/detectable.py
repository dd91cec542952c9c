"""Sizes at which the posterior tells an effect: by its odds before the data, its rivals, and its sigma in this test.

With one effect of size b (in units of its prior size) beside nothing else, its pull in the data is ``J b`` and noise of
variance J; what look-alikes and noises pull follows from it. The log odds of its family, over nothing, rise with the
pull. The score z at which they are even is what a test must reach: from there a diagnosis tells something, the effect
itself or what looks the same. Of effects whose expected score is 0.84 beyond it, 80 % reach it (noise moves the score
by one). Look-alikes of other families count for neither side: they are in the class that is told, but alone they lead
to no telling.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.evidence.linear import E
from sdimu_calibration.core.evidence.testable import INDISTINGUISHABLE
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.posterior.board import Board
from sdimu_calibration.core.posterior.family import family_of
from sdimu_calibration.core.posterior.models import Data
from sdimu_calibration.core.posterior.noise_models import NoiseModel, usual_sizes
from sdimu_calibration.core.posterior.prior import WIDTH_SHARES, WIDTHS
from sdimu_calibration.core.posterior.rival_noise import Rivals, no_rivals, rivals

POWER = 0.8
"""Share of tests (1) in which an effect of the size that is stated is told: the usual power of a test."""
POWER_SIGMAS = 0.8416
"""Score (sigma) by which an effect must lie beyond a limit that `POWER` of tests are to reach: the quantile of the
normal distribution."""
_LARGEST = 100.0
"""Largest score (sigma) that is looked at: what is not told there is told at no size."""
_USUAL = 8.0
"""Score (sigma) that is looked at first: most are told from less."""
_NEAR = 0.01
"""Width (sigma) to which the interval of a score is halved: no size is stated to a hundredth of its sigma."""
_TAKES = 0.03
"""Share (1) of the information on an effect below which a noise is no rival of it: it stands beside it as it stands
beside nothing, and the odds stay the same."""
_ALIKE = 0.7
"""Correlation (1) of signatures from which two effects are held against each other: less, and the data part them."""
_ITSELF = 1.0 - 1e-8
"""Correlation (1) from which two signatures are one: a model has one of them alone, which is the candidate."""
_WIDTHS = np.column_stack([np.array(WIDTHS) ** -2.0, np.log(WIDTH_SHARES)])
"""Prior information of each width and the log of its share (1): as the models of a diagnosis have them."""


@dataclass(frozen=True)
class Scores:
    """Of q candidates of a board."""

    column: Ints
    """Columns of the evidence, shape (q,)."""
    sigma: Floats
    """Of each beside the model, in the noise that is there (SI), shape (q,)."""
    needed: Floats
    """Expected score (sigma) with which it is told in `POWER` of tests, shape (q,); inf where it is at no size."""

    @property
    def size(self) -> dict[int, float]:
        """Size (SI) that is told in `POWER` of tests, by column."""
        return dict(zip(self.column.tolist(), (self.needed * self.sigma).tolist(), strict=True))


def told_from(board: Board[E], terms: Sequence[NoiseTerm] = ()) -> Scores:
    """Work out from which score on each candidate is told, alone or as one of those that look the same.

    Parameters
    ----------
    board : Board
        Of a diagnosis.
    terms : sequence of NoiseTerm
        Noise that is in the recording.
    """
    data = board.data(NoiseModel(tuple(terms)))[1]
    q = len(board.use)
    noises = no_rivals(q)
    if board.joint is not None:
        noises = rivals(board.joint, board.use, terms, usual_sizes(board.evidence.imu), board.excess)
    own = np.maximum(np.diag(data.J), 0.0)
    sigma = np.divide(board.size, np.sqrt(own), out=np.full(q, np.inf), where=own > 0.0)
    families = [family_of(board.evidence.candidate(column)) for column in board.use.tolist()]
    number = {family: k for k, family in enumerate(dict.fromkeys(families))}
    of_family = np.array([number[family] for family in families], dtype=np.int64)
    return Scores(board.use, sigma, _even(data, of_family, noises) + POWER_SIGMAS)


def _even(data: Data, family: Ints, noises: Rivals) -> Floats:
    """Score of each candidate at which its family is as likely as nothing (sigma); `family` (q,) numbers it."""
    own = np.maximum(np.diag(data.J), 1e-300)
    unit = 1.0 / np.sqrt(own)
    alike = data.J * np.outer(unit, unit)
    place, other = np.nonzero((np.abs(alike) > _ALIKE) & (family[:, None] == family))
    begin = np.searchsorted(place, np.arange(len(own) + 1))
    rho = alike[place, other]
    parted = np.sqrt(2.0 * INDISTINGUISHABLE / np.maximum(1.0 - rho**2, 1e-300))
    near = np.column_stack([other.astype(np.float64), rho, parted])
    table = np.column_stack([own, data.prior.log_more(())])
    return np.asarray(even_scores(table, data.prior.positive, near, begin, noises.offset, noises.taken, _WIDTHS))


@compiled
def _log_factor(c: float, r: float, widths: Floats) -> float:
    """Log Bayes factor of an effect: c, r its information and pull in units of its prior size."""
    best = -np.inf
    parts = np.empty(len(widths))
    for w in range(len(widths)):
        a = c + widths[w, 0]
        parts[w] = 0.5 * r * r / a - 0.5 * np.log(a / widths[w, 0]) + widths[w, 1]
        best = max(best, parts[w])
    return float(best + np.log(np.sum(np.exp(parts - best))))


@compiled
def _log_sum(one: float, other: float) -> float:
    """Log of the sum of two numbers that are given by their logs."""
    high, low = max(one, other), min(one, other)
    return high if low == -np.inf else float(high + np.log1p(np.exp(low - high)))


@compiled
def _log_odds(
    z: float, own: Floats, positive: Bools, table: Floats, near: Floats, noise: tuple[Floats, Floats], widths: Floats
) -> float:
    """Log odds (1) of the family of a candidate over nothing, at its score z.

    own : information on it in units of its prior size, and its log odds; table : those of all; near : places of those
    of its family that look alike, their correlations, and the scores from which the data part them; noise : log weights
    of rivals, and the shares that they take.
    """
    c, pull = own[0], z * np.sqrt(own[0])
    alone = _log_factor(c, pull, widths) + own[1]
    whole = alone
    for k in range(len(near)):
        j, rho = int(near[k, 0]), near[k, 1]
        if z > near[k, 2] or abs(rho) >= _ITSELF or (positive[j] and rho < 0.0):
            continue
        whole = _log_sum(whole, _log_factor(table[j, 0], z * rho * np.sqrt(table[j, 0]), widths) + table[j, 1])
    there, none = whole, 0.0
    for m in range(len(noise[0])):
        share = noise[1][m]
        if share < _TAKES:
            continue
        weight = noise[0][m] + 0.5 * z * z * share
        beside = _log_factor(c * (1.0 - share), pull * (1.0 - share), widths) + own[1]
        there = _log_sum(there, weight + beside + whole - alone)
        none = _log_sum(none, weight)
    return float(there - none)


@compiled
def even_scores(
    table: Floats, positive: Bools, near: Floats, begin: Ints, offset: Floats, taken: Floats, widths: Floats
) -> Floats:
    """Score at which the log odds of each of q candidates, and of what of its family looks the same, are zero.

    Parameters
    ----------
    table : ndarray, shape (q, 2)
        Information on each in units of its prior size, and its log odds before the data (1).
    positive : ndarray of bool, shape (q,)
        Whose size cannot be negative.
    near : ndarray, shape (k, 3)
        Places of those of its family that look alike, their correlation with a candidate (1), and the score from which
        the data part the two (sigma), candidate by candidate.
    begin : ndarray of int, shape (q + 1,)
        Where those of each begin.
    offset : ndarray, shape (m,)
        Log weights of rival noises beside none (1).
    taken : ndarray, shape (q, m)
        Share of the information on a candidate that each takes (1).
    widths : ndarray, shape (w, 2)
        Prior information of each width (1), and the log of its share (1).

    Returns
    -------
    ndarray, shape (q,)
        sigma; inf where they are at no score that is looked at.
    """
    out = np.empty(len(table))
    for j in range(len(table)):
        alike, noise = near[begin[j] : begin[j + 1]], (offset, taken[j])
        low, high = 0.0, _USUAL
        if not _log_odds(high, table[j], positive, table, alike, noise, widths) > 0.0:
            low, high = high, _LARGEST
            if not _log_odds(high, table[j], positive, table, alike, noise, widths) > 0.0:
                out[j] = np.inf
                continue
        while high - low > _NEAR:
            middle = 0.5 * (low + high)
            if _log_odds(middle, table[j], positive, table, alike, noise, widths) > 0.0:
                high = middle
            else:
                low = middle
        out[j] = high
    return out
