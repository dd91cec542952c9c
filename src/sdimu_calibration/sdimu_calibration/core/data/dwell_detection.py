"""Dwells of a recording without a status, where the specification is too wide a measure of rest.

`phases` calls an IMU at rest when its readings are within what bias and noise of the specification allow. That serves a
navigation-grade IMU: its bias is less than any turn. A gyro whose bias may be degrees per second would turn unnoticed.
Here the usual reading of the gyros, and the scatter of the quiet windows, are the measure (`Windows.still`), and what
is found takes the place of the status.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.data.phases import rest_limits
from sdimu_calibration.core.data.windows import Windows, cut_windows, runs, samples_of
from sdimu_calibration.core.recording import UNNUMBERED, PhaseLog, Recording
from sdimu_calibration.core.specification import ImuSpecification

_WIDE = float(np.radians(0.1))
"""Limit of rest (rad/s): beyond it a slow turn may pass for a rest."""
_WINDOW_S = 0.5
"""Length of a window (s): long enough for a mean, short against a rest."""
_SHORTEST_S = 2.0
"""Shortest rest (s): what is shorter is a part of the turn."""
_FAST = 8.0
"""Rate of a turn, as a multiple of the largest that passes for rest (1), up to which its ramp is followed: a rate that
grows with the square of time has needed half as long to the largest, one that grows with its cube as long."""
_MOST_UNSEEN = 10
"""Number of windows at most in which a turn goes on unseen: five seconds, the ramp of a table at a few deg/s."""
_REMEMBERED = 4096
"""Number of windows from which a running test learns noise and usual reading: half an hour and more."""
_BEGIN = 6
"""Number of windows at the beginning of a running test that are taken for rest: three seconds."""
_FEWEST_CALM = 20
"""Number of windows at rest from which noise is learned: ten seconds give it to a fifth."""


def specification_is_wide(imu: ImuSpecification) -> bool:
    """Whether bias and noise of the specification allow readings like those of a turn."""
    return rest_limits(imu).rate > _WIDE


def with_detected_dwells(recording: Recording, imu: ImuSpecification) -> Recording:
    """Add the dwells that the samples show, where there is no status and the specification cannot tell.

    Returns
    -------
    Recording
        The same object when nothing is to be done; else with a note.
    """
    if recording.phase is not None or not specification_is_wide(imu):
        return recording
    log = detected_dwells(recording)
    if log is None:
        return recording
    note = (
        "no status, and the specification of the gyros allows a bias like a turn: rests were found by the scatter of "
        "the quiet parts"
    )
    return replace(recording, phase=log, notes=(*recording.notes, note))


def detected_dwells(recording: Recording) -> PhaseLog | None:
    """Find the dwells from the samples; None when there are none."""
    windows = cut_windows(recording.t, recording.omega_ib_b, recording.f_ib_b, _WINDOW_S)
    still = windows.still
    log = _dwells(windows, still & ~_unseen_ramps(windows, still))
    return log if log.dwell.any() else None


def _unseen_ramps(windows: Windows, still: Bools) -> Bools:
    """Windows (k,) of a turn that begins or ends so softly that the gyros do not show it there.

    The rate of a soft turn grows with the square of time or faster. From where it shows it needs as long again, and
    more, to eight times as much: so long it may have gone on unseen.
    """
    unseen = np.zeros(len(still), dtype=bool)
    if not still.any():
        return unseen
    turning = windows.turning(windows.quiet)
    for first, last in zip(*runs(~still), strict=True):
        fast = np.flatnonzero(turning[first:last] > _FAST)
        if len(fast):
            unseen[max(0, first - min(int(fast[0]), _MOST_UNSEEN)) : first] = True
            unseen[last : last + min(last - first - 1 - int(fast[-1]), _MOST_UNSEEN)] = True
    return unseen


def _dwells(windows: Windows, still: Bools) -> PhaseLog:
    """Phase of each window from those that are still (k,)."""
    # Motion that fills a part of a window only is not always seen in it: its neighbours count as motion too.
    moving = ~still
    moving[1:] |= ~still[:-1]
    moving[:-1] |= ~still[1:]
    dwell = np.zeros(len(still), dtype=bool)
    stop = np.zeros(len(still), dtype=np.int64)
    count = 0
    for first, last in zip(*runs(~moving), strict=True):
        if windows.end[last - 1] - windows.start[first] >= _SHORTEST_S:
            dwell[first:last] = True
            stop[first:] = count
            count += 1
    return PhaseLog(windows.start, dwell, stop, stated=False)


class GrowingDwells:
    """The dwells of a test that is still going on, from the samples so far.

    Soft beginnings of turns are found at the end alone: they are told by what comes after them.

    The test begins at rest, or the filter on the way has no attitude to begin with: the first windows show the usual
    reading of the gyros and its noise, later on all that were called rest. Half of the windows so far, the measure of a
    whole recording, may be one long turn. Only the last `_REMEMBERED` windows are kept, so that work and memory stay
    bounded.

    Parameters
    ----------
    interval_s : float
        Nominal interval of the samples.
    """

    def __init__(self, interval_s: float) -> None:
        self._interval_s = interval_s
        self._length, self._side = samples_of(_WINDOW_S, interval_s)
        self._rest = (np.empty(0), np.empty((0, 3)), np.empty((0, 3)))
        self._windows: Windows | None = None
        self._calm = np.zeros(0, dtype=bool)
        """Windows that were called rest when they were decided."""
        self._decided_s = -np.inf

    def add(self, t: Floats, omega_ib_b: Floats, f_ib_b: Floats) -> None:
        """Take samples.

        Parameters
        ----------
        t : ndarray, shape (n,)
            Time (s), ascending.
        omega_ib_b, f_ib_b : ndarray, shape (n, 3)
            Rate and force (rad/s, m/s^2).
        """
        t, w, f = (np.concatenate(pair) for pair in zip(self._rest, (t, omega_ib_b, f_ib_b), strict=True))
        # `cut_windows` leaves out the first of its windows, and here the first of each piece is the last one before it.
        whole = max((len(t) - self._side) // self._length - 1, 0)
        if whole:
            found = cut_windows(t, w, f, _WINDOW_S, self._interval_s)
            joined = found if self._windows is None else self._windows.followed_by(found)
            self._windows = joined[-_REMEMBERED:]
            self._calm = np.concatenate([self._calm, np.zeros(len(found), dtype=bool)])[-_REMEMBERED:]
        kept = slice(whole * self._length, None)
        self._rest = (t[kept], w[kept], f[kept])

    def log(self) -> tuple[PhaseLog | None, float]:
        """Phases so far without numbers of stops, and the time (s) up to which they are decided."""
        if self._windows is None or not len(self._windows):
            return None, 0.0
        windows = self._windows
        calm = self._calm
        if calm.sum() < _FEWEST_CALM:
            calm = windows.still_as(np.arange(len(windows)) < _BEGIN)
        found = _dwells(windows, windows.still_as(calm))
        # The last window may count as motion of the next; a rest must last until it counts as a dwell.
        last = len(windows) - 1
        while last > 0 and not found.dwell[last - 1] and windows.end[-1] - found.t[last - 1] < _SHORTEST_S + _WINDOW_S:
            last -= 1
        decided_s = max(self._decided_s, float(found.t[last]))
        new = (found.t >= self._decided_s) & (found.t < decided_s)
        self._calm[new] = found.dwell[new]
        self._decided_s = decided_s
        return PhaseLog(
            found.t, self._calm | (found.dwell & (found.t >= decided_s)), _unnumbered(found), False
        ), decided_s


def _unnumbered(log: PhaseLog) -> Ints:
    return np.full(len(log.t), UNNUMBERED, dtype=np.int64)
