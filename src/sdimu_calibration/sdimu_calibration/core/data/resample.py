"""Samples with stamps of their own brought to other stamps, keeping what they add up to."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints

Stamps = Ints

_SAME = 0.1
"""Stamps that differ by less than this share of the interval are the same: jitter of whoever wrote them."""
_GAP = 2.5
"""Interval, as a multiple of the usual one, that is a gap: jitter stays below."""


def same_stamps(a: Stamps, b: Stamps) -> bool:
    """Tell whether two lists of stamps are the same samples.

    Parameters
    ----------
    a, b : ndarray of int, shapes (n,) and (m,)
        ns.
    """
    if len(a) != len(b):
        return False
    interval = float(np.median(np.diff(a))) if len(a) > 1 else 0.0
    return bool((np.abs(a - b) <= _SAME * max(interval, 0.0)).all())


def mean_over(wanted_ns: Stamps, ns: Stamps, value: Floats) -> tuple[Bools, Floats]:
    """Average samples over other intervals.

    Samples are means over the interval that ends at their stamp, so their running sum is known at the stamps; between
    them it is taken as straight. The sum over any stretch is kept, which interpolation of the values would not do.

    Parameters
    ----------
    wanted_ns : ndarray, shape (n,)
        Ends of the intervals to average over (ns); each begins at the one before, or, after a gap, the usual interval
        before its end.
    ns : ndarray, shape (m,)
        Stamps of the samples (ns).
    value : ndarray, shape (m, k)

    Returns
    -------
    kept : ndarray of bool, shape (n,)
        False where samples are missing; stamps out of order are not used.
    mean : ndarray, shape (kept.sum(), k)
    """
    order = np.unique(ns, return_index=True)[1]
    at, value = ns[order], value[order]
    if len(at) < 2 or not len(wanted_ns):
        return np.zeros(len(wanted_ns), dtype=bool), np.empty((0, value.shape[1]))
    usual, wanted_usual = float(np.median(np.diff(at))), _usual(wanted_ns)
    zero = int(at[0])
    t, step = (at - zero).astype(np.float64), np.concatenate([[usual], np.diff(at)])
    total = np.cumsum(value * np.minimum(step, _GAP * usual)[:, None], axis=0)

    end = (wanted_ns - zero).astype(np.float64)
    before = np.concatenate([[np.inf], np.diff(wanted_ns)])
    length = np.where((before > 0) & (before <= _GAP * wanted_usual), before, wanted_usual)
    inside = (end - length >= t[0] - usual) & (end <= t[-1])
    gaps = np.concatenate([[0], np.cumsum(step > _GAP * usual)])
    first, last = np.searchsorted(t, end - length, side="right"), np.searchsorted(t, end)
    whole = gaps[np.minimum(last, len(t) - 1) + 1] == gaps[np.minimum(first, len(t) - 1)]
    kept = inside & whole
    t0, total0 = np.concatenate([[-usual], t]), np.vstack([np.zeros(value.shape[1]), total])
    ends, starts = (
        np.column_stack([np.interp(x[kept], t0, column) for column in total0.T]) for x in (end, end - length)
    )
    return kept, np.asarray((ends - starts) / length[kept, None])


def _usual(ns: Stamps) -> float:
    return float(np.median(np.diff(ns))) if len(ns) > 1 else 1.0
