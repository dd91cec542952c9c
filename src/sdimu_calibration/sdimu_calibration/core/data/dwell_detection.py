"""Dwells of a recording without a status, where the specification is too wide a measure of rest.

`phases` calls an IMU at rest when its readings are within what bias and noise of the specification allow. That serves a
navigation-grade IMU: its bias is less than any turn. A gyro whose bias may be degrees per second would turn unnoticed.
Here the usual reading of the gyros, and the scatter of the quiet windows, are the measure (`Windows.still`), and what
is found takes the place of the status.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sdimu_calibration.core.data.phases import rest_limits
from sdimu_calibration.core.data.windows import cut_windows
from sdimu_calibration.core.recording import PhaseLog, Recording
from sdimu_calibration.core.specification import ImuSpecification

_WIDE = float(np.radians(0.1))
"""A limit of rest beyond this (rad/s) may let a slow turn pass."""
_WINDOW_S = 0.5
_SHORTEST_S = 2.0
"""Rests that are shorter are a part of the turn."""


def with_detected_dwells(recording: Recording, imu: ImuSpecification) -> Recording:
    """Add the dwells that the samples show, where there is no status and the specification cannot tell.

    Returns
    -------
    Recording
        The same object when nothing is to be done; else with a note.
    """
    if recording.phase is not None or rest_limits(imu).rate <= _WIDE:
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
    if not len(windows):
        return None
    still = windows.still
    # Motion that fills a part of a window only is not always seen in it: its neighbours count as motion too.
    moving = ~still
    moving[1:] |= ~still[:-1]
    moving[:-1] |= ~still[1:]
    edges = np.flatnonzero(np.diff(np.concatenate([[True], moving, [True]]).astype(np.int64)))
    dwell = np.zeros(len(still), dtype=bool)
    stop = np.zeros(len(still), dtype=np.int64)
    count = 0
    for first, last in edges.reshape(-1, 2):
        if windows.end[last - 1] - windows.start[first] >= _SHORTEST_S:
            dwell[first:last] = True
            stop[first:] = count
            count += 1
    return PhaseLog(windows.start, dwell, stop) if count else None
