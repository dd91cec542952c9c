"""Readings that come once more under another stamp: a relay that publishes on the topic which it listens to.

Noise does not repeat itself. A coarse sensor does, but at any distance and more than twice; messages that are sent
twice have one stamp.
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.data.clock_steps import usual_interval
from sdimu_calibration.core.data.stream_values import ADVICE, Samples, Split, in_blocks

_REPEATED = 0.05
"""Share of samples whose values were there before from which a relay is looked for: a short one does no harm."""
_SAME_DELAY = 0.9
"""Share of the repeated values that come at one delay from which they are those of a relay: a coarse sensor repeats
its values at any distance."""
_TWICE = 2
"""Number of times that a relay brings a reading: a coarse sensor repeats its own more often."""
_DELAY_SCATTER = 0.5
"""Scatter of that delay (intervals): the jitter of two computers."""


def relayed(samples: Samples, rows: Ints) -> Split | None:
    """Tell readings that come once more under another stamp.

    Parameters
    ----------
    rows : ndarray of int, shape (n,)
        Rows of finite samples by their stamps.

    Returns
    -------
    Split or None
        The later ones; None where readings do not repeat, or as those of a coarse sensor do.
    """
    some = np.sort(_marks(samples.values(rows[in_blocks(rows)])), axis=1)
    if np.mean(some[:, 1:] == some[:, :-1]) < _REPEATED:
        return None
    marks = _marks(samples.values(rows))
    order = np.argsort(marks, kind="stable")
    first = np.flatnonzero(np.diff(marks[order], prepend=~marks[order[0]]))
    times = np.diff(first, append=len(order))
    again = first[times == _TWICE] + 1
    delay = samples.ns[rows[order[again]]] - samples.ns[rows[order[again - 1]]]
    again, delay = again[delay > 0], delay[delay > 0]
    if _TWICE * len(again) < max(_REPEATED * len(rows), _SAME_DELAY * times[times > 1].sum()):
        return None
    usual = float(np.median(delay))
    near = np.abs(delay - usual) <= _DELAY_SCATTER * usual_interval(samples.ns[rows])
    if near.mean() < _SAME_DELAY:
        return None
    out = rows[order[again]]
    note = (
        f"{samples.topic}: {len(out)} of {len(rows)} samples are others once more, {usual * 1e-6:.3g} ms later, and "
        f"left out (a relay publishes on the same topic, or the driver sends each reading twice); {ADVICE}"
    )
    return Split(out, note)


def _marks(values: Floats) -> Ints:
    """One number for each row (..., 6) that equal rows share."""
    bits = np.ascontiguousarray(values + 0.0).view(np.uint64)
    return np.asarray((bits * (2 * np.arange(6, dtype=np.uint64) + np.uint64(0x9E3779B97F4A7C15))).sum(axis=-1))
