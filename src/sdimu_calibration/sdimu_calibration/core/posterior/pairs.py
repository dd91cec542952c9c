"""The best two candidates to add at once: half a million scores, one after the other."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.compiled import compiled

_SINGULAR = 1e-9
"""Share (1) of the product of two informations that their determinant must have: less is rounding."""


@compiled
def _best_width(x: float, one: Floats, other: Floats, widths: Floats, least: float) -> tuple[float, int]:
    """Log Bayes factor of a pair by the width of its sizes that it fits best, where that exceeds `least`; the width."""
    best, at, p, q = -np.inf, 0, one[1], other[1]
    for width in range(len(widths)):
        loading = widths[width, 0]
        a, b = one[0] + loading, other[0] + loading
        det = a * b - x * x
        first, second = p * b - x * q, q * a - x * p
        if not det > _SINGULAR * a * b or (one[3] and first < 0.0) or (other[3] and second < 0.0):
            continue
        score = 0.5 * (p * first + q * second) / det + 2.0 * widths[width, 1]
        # The logarithm takes longer than all else: it is taken where it can matter.
        if score - 0.5 * np.log(_SINGULAR) > least:
            score -= 0.5 * np.log(det / loading**2)
            if score > best:
                best, at = score, width
    return best, at


@compiled
def best_pair(
    X: Floats, table: Floats, apart: Ints, kin: Ints, widths: Floats, more: float
) -> tuple[float, int, int, int]:
    """Score every pair of candidates beside a model, one of which is among the first m.

    Parameters
    ----------
    X : ndarray, shape (m, u)
        Information across the first candidates and all beside the model, in units of the prior sizes.
    table : ndarray, shape (u, 4)
        Information on each (1), its pull (1), its log odds beside the model (1), and 1 where its size cannot be
        negative.
    apart : ndarray of int, shape (u, 3)
        Two that share a number in one column exclude each other.
    kin : ndarray of int, shape (u,)
        Two that share a number have one cause.
    widths : ndarray, shape (w, 2)
        Prior information of each width (1), and the log of its share (1).
    more : float
        Log odds of two that have one cause (1).

    Returns
    -------
    best : float
        Log posterior that the pair adds, without the share of the number of effects (1); -inf without a pair.
    i, j : int
        Places of the pair.
    width : int
    """
    best, at_i, at_j, at_width = -np.inf, 0, 0, 0
    for i in range(len(X)):
        for j in range(i + 1, len(table)):
            if apart[i, 0] == apart[j, 0] or apart[i, 1] == apart[j, 1] or apart[i, 2] == apart[j, 2]:
                continue
            x = X[i, j]
            odds = table[i, 2] + table[j, 2] + (more if kin[i] == kin[j] else 0.0)
            score, width = _best_width(x, table[i], table[j], widths, best - odds)
            if score + odds > best:
                best, at_i, at_j, at_width = score + odds, i, j, width
    return best, at_i, at_j, at_width
