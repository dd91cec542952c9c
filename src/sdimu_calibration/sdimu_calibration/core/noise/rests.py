"""Rests of a recording whose samples are noise alone: those of static detection, long, and whole."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.data.static_detection import joined, still_samples
from sdimu_calibration.core.data.windows import runs
from sdimu_calibration.core.recording import DataError, PhaseLog, Recording

WINDOW_S = 1.0
"""Length of a window (s): as much is left to settling at both ends of a rest."""
_FEWEST = 10
"""Number of samples of a window at least: fewer give no mean."""
TURNING = float(np.radians(0.3))
"""Mean rate (rad/s) apart from that of rest that is a turn: below every table's, above every drift of a bias."""
_MISSING = 1.5
"""Distance of two samples (intervals) from which one is missing: an Allan deviation counts samples for time."""
_WHOLE_S = 60.0
"""Longest gap between two pieces of one rest (s): beyond it the drift of a cheap gyro hides a slow turn."""
_SHORTEST = 8
"""Number of windows that make a rest: fewer may be a slow part of a turn."""


def rests(recording: Recording) -> tuple[slice, ...]:
    """Find where the IMU is at rest.

    A sample is at rest when the second about it scatters no more than the quietest do, its mean rate is theirs, no
    sample is missing, and the table (where it says anything) dwells. A second at both ends of each rest is left out.

    Gives rows of the recording, in order.
    """
    size = _window(recording)
    first, last = runs(at_rest(recording))
    long = last - first >= 2 * size
    if long.any():
        first, last = joined(recording, first[long], last[long], _WHOLE_S)
    found = tuple(
        slice(int(a) + size, int(b) - size)
        for a, b in _whole(recording, first, last)
        if b - a >= (_SHORTEST + 2) * size
    )
    if not found:
        raise DataError(
            f"/imu/data_raw: no rest of {_SHORTEST + 2} s in {recording.t[-1]:.0f} s; record the IMU while it stands "
            "still, an hour or more for its slow noise"
        )
    return found


def at_rest(recording: Recording) -> Bools:
    """Find the samples about which the IMU rests for a second, and the table dwells if it says anything, shape (n,)."""
    size = _window(recording)
    if len(recording.t) <= size:
        return np.zeros(len(recording.t), dtype=bool)
    return still_samples(recording, size, TURNING, _MISSING) & _dwells(recording)


def _window(recording: Recording) -> int:
    """Return the number of samples of a window."""
    return max(round(WINDOW_S / recording.interval_s), _FEWEST)


def _whole(recording: Recording, first: Ints, last: Ints) -> Iterator[tuple[int, int]]:
    """Cut the rests again where samples are missing."""
    holes = np.flatnonzero(np.diff(recording.t) > _MISSING * recording.interval_s) + 1
    for a, b in zip(first, last, strict=True):
        inside = holes[(holes > a) & (holes < b)]
        yield from zip([int(a), *inside], [*inside, int(b)], strict=True)


def _dwells(recording: Recording) -> Bools:
    """Find the samples in whose interval the table dwells at one stop, or says nothing, shape (n,)."""
    log, t = recording.phase, recording.t
    if log is None or not len(log.t):
        return np.ones(len(t), dtype=bool)
    first = _entry(log, t - recording.interval_s + 1e-6)
    last = _entry(log, t - 1e-6)
    turning = np.concatenate([[0], np.cumsum(~log.dwell)])
    return np.asarray((turning[last + 1] == turning[first]) & (log.stop[first] == log.stop[last]))


def _entry(log: PhaseLog, t: Floats) -> Ints:
    """Entry of the log that holds at each time; the first one before all."""
    return np.maximum(np.searchsorted(log.t, t, side="right") - 1, 0)
