"""Readings at the end of a sensor's range: what such a reading should have been, nobody knows."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.data.windows import runs
from sdimu_calibration.core.recording import Recording

_LEAST_IN_A_ROW = 3
"""Least number of consecutive measurements at the extreme number that is saturation: noise does not repeat its
extreme."""


def at_range_end(recording: Recording) -> Bools:
    """Say which readings of each channel stand at its largest or smallest number, several in a row.

    Returns
    -------
    ndarray of bool, shape (n, 6)
        Three gyros, then three accelerometers. A channel that shows one number throughout has no end of a range.
    """
    columns = [_clipped(x) for triad in (recording.omega_ib_b, recording.f_ib_b) for x in triad.T]
    return np.column_stack(columns)


def _clipped(x: Floats) -> Bools:
    if x.min() == x.max():
        return np.zeros(len(x), dtype=bool)
    least = _LEAST_IN_A_ROW * _readings_each(x)
    return _in_a_row(x == x.max(), least) | _in_a_row(x == x.min(), least)


def _readings_each(x: Floats) -> int:
    """Count the readings of one measurement: a logger faster than its sensor writes each several times."""
    ends = np.flatnonzero(x[1:] != x[:-1])
    return round(float(np.median(np.diff(ends, prepend=-1, append=len(x) - 1))))


def _in_a_row(flags: Bools, least: int) -> Bools:
    """Keep runs of `least` and more."""
    out = np.zeros(len(flags), dtype=bool)
    for a, b in zip(*runs(flags), strict=True):
        out[a:b] = b - a >= least
    return out
