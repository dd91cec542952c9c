"""Single samples of another sensor between those of the IMU: one more than its clock has, with other values."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Ints
from sdimu_calibration.core.data.clock_steps import usual_interval
from sdimu_calibration.core.data.stream_values import Samples, Split, in_blocks, off_clock, off_line
from sdimu_calibration.core.plain_text import counted
from sdimu_calibration.core.probability import GAUSS_MAD

_APART = 6.0
"""Ratio of the distance of a stray from its neighbours to the noise (1), at least: by chance it stays below."""
_SIDE = 5
"""Number of samples to each side that say how rough the motion is: as long as it takes a turn to begin."""
_ROUGH = 2.0
"""Ratio of the distance of a stray to the largest one of the samples about it (1), at least: noise is alike."""
_MOVED = 5.0
"""Number of intervals in which a turn may explain the distance: a clock set back gives samples stamps of others."""
_NEIGHBOURS = 1.3
"""Distance (intervals) of the samples before and behind a stray at most: none of them is missing, so it is one more."""


def foreign_samples(samples: Samples, clock: Ints, left: Ints, after: Ints) -> Split | None:
    """Tell single samples between two others of the clock, none missing, whose values do not belong there.

    Parameters
    ----------
    clock, left, after : ndarray of int
        As for `off_clock`; `left` has the shape (m,).

    Returns
    -------
    Split or None
        None where all belong there.
    """
    interval = usual_interval(samples.ns[clock])
    inside = samples.ns[clock[after]] - samples.ns[clock[after - 1]] < _NEIGHBOURS * interval
    left, after = left[inside], after[inside]
    if not len(left):
        return None
    off = np.abs(off_clock(samples, clock, left, after))
    around = np.clip(after[:, None] + np.arange(-_SIDE - 1, _SIDE + 1), 0, len(clock) - 1)
    beside = samples.values(clock[around])
    rough = np.abs(off_line(beside)).max(axis=1)
    change = np.abs(beside[:, -1] - beside[:, 0]) / (around.shape[1] - 1)
    noise = GAUSS_MAD * np.median(np.abs(off_line(samples.values(clock[in_blocks(clock)]))), axis=(0, 1))
    foreign = (off > np.maximum(_APART * noise, np.maximum(_ROUGH * rough, _MOVED * change))).any(axis=1)
    if not foreign.any():
        return None
    # Of the same sensor are those, too, whose values happen to fit: they are one more all the same.
    number = counted(len(left), "sample is", "samples are")
    first = (samples.ns[left[0]] - samples.ns[clock[0]]) * 1e-9
    note = (
        f"{samples.topic}: {number} of another sensor and left out (the first {first:.1f} s after the start): more "
        "than the even clock of the others has, with other values; look for a second publisher"
    )
    return Split(left, note)
