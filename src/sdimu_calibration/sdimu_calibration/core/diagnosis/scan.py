"""One pass over all candidates: score, testability, threshold, class.

A candidate's score z is its estimate over its sigma when it is added to the model alone, all coefficients being
estimated again. For linear Gaussian data z^2 is the fall of chi-square of a refit (score test = likelihood ratio).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.evidence.information import Information
from sdimu_calibration.core.evidence.testable import INDISTINGUISHABLE, TESTABLE
from sdimu_calibration.core.side_by_side import side_by_side

_DRAWS = 4000
"""Number of draws of noise: at a false-alarm probability of 0.02, 80 of them are beyond the threshold, which is then
right to a tenth of that probability."""
_ROWS = 150
"""Number of candidates whose scores are drawn at a time: of a triangle of 1500 rows little is drawn twice."""
_JITTER = 1e-6
"""Variance added to that of every score (1): identical signatures have a singular correlation."""


@dataclass(frozen=True)
class Scan:
    """Scores of all candidates given a model."""

    z: Floats
    """Shape (q,). Estimate over sigma; 0 where not testable."""
    estimate: Floats
    sigma: Floats
    """`estimate`, `sigma`: shape (q,). SI; sigma is inf where not testable."""
    retention: Floats
    """Share of the signature that the model leaves, shape (q,)."""
    J: Floats
    d: Floats
    """`J`, `d`: shape (q,). Information on each parameter (1/sigma^2, SI) and the information vector, given the model:
    the estimate is d / J."""


def scan(full: Information, known: Ints, weight: Floats) -> Scan:
    """Score every parameter given those at `known`.

    Parameters
    ----------
    known : ndarray of int, shape (k,)
        Model and effects already added.
    weight : ndarray, shape (k,)
        Prior information of each (1/sigma^2, SI).
    """
    (J, d), J0 = full.diagonal_given(known, weight), np.diag(full.J)
    with np.errstate(divide="ignore", invalid="ignore"):
        retention = np.sqrt(np.maximum(J, 0.0) / J0)
        testable = (retention > TESTABLE) & (J0 > 0.0)
        testable[known] = False
        sigma = np.where(testable, 1.0 / np.sqrt(J), np.inf)
        estimate = np.where(testable, d / J, 0.0)
    z = np.where(testable, estimate / sigma, 0.0)
    return Scan(z, estimate, sigma, np.nan_to_num(retention), J, d)


def threshold(full: Information, known: Ints, weight: Floats, tested: Ints, alpha: float, seed: int = 1) -> float:
    """Size of the largest ``|z|`` that pure noise exceeds with probability `alpha`.

    The scores of pure noise are jointly normal with the correlation of the signatures, so the whole scan is simulated
    by drawing from it; correlated candidates cost less than Bonferroni would charge.

    Parameters
    ----------
    known : ndarray of int, shape (k,)
        Model and effects already added.
    weight : ndarray, shape (k,)
        Prior information of each (1/sigma^2, SI).
    tested : ndarray of int, shape (t,)
        Columns that are tested.
    alpha : float
        False-alarm probability of the whole scan.
    """
    if not len(tested):
        return float("inf")
    cut = np.concatenate([known, tested])
    place = np.arange(len(known))
    given = Information(full.J[np.ix_(cut, cut)], full.d[cut]).given(place, weight)
    C = correlation(given.J[len(known) :, len(known) :])
    root = np.linalg.cholesky(C + _JITTER * np.eye(len(C)))
    rng = np.random.default_rng(seed)
    draws = rng.standard_normal((len(C), _DRAWS))

    def largest(begin: int) -> Floats:
        # The root is triangular: no row needs draws behind it.
        end = min(begin + _ROWS, len(C))
        return np.asarray(np.abs(root[begin:end, :end] @ draws[:end]).max(axis=0))

    return float(np.quantile(np.max(side_by_side(largest, range(0, len(C), _ROWS)), axis=0), 1.0 - alpha))


def correlation(J: Floats) -> Floats:
    """Correlation of signatures.

    Parameters
    ----------
    J : ndarray, shape (t, t)
        Information on their parameters, in any units; its diagonal is positive.

    Returns
    -------
    ndarray, shape (t, t)
        Dimensionless.
    """
    s = 1.0 / np.sqrt(np.diag(J))
    return np.asarray(J * np.outer(s, s))


def alike(scores: Floats, best: int) -> list[int]:
    """Candidates that the data cannot tell from one of them, the highest score first.

    Parameters
    ----------
    scores : ndarray, shape (q,)
        Log Bayes factor of each against the model without it (1); -inf where it does not count.
    best : int
        Index of the one.

    Returns
    -------
    list of int
        Indices, those that score better than the one among them.
    """
    gap = scores[best] - scores
    return [int(i) for i in np.argsort(gap) if i != best and gap[i] < INDISTINGUISHABLE]
