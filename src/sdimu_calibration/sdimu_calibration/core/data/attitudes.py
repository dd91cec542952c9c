"""Which attitudes a recording shows: one alone, or several with the turns between them left out."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.data.windows import cut_windows
from sdimu_calibration.core.recording import Recording

_WINDOW_S = 4.0
"""Length of a window (s): longer than the rocking of a building, a ship or a foundation."""
_PIECE_S = 1.0
"""Length of a window (s) in a piece of a recording: a piece of some seconds has several."""
_TILT = np.radians(3.0)
"""Largest change of the direction of gravity (rad) that is no other attitude: what a base that rocks does."""
_TURN = np.radians(5.0)
"""Largest angle turned about the vertical (rad) that is no other attitude: what a drift of the gyros looks like."""
_OTHER = np.radians(10.0)
"""Least angle between two attitudes (rad) that are two: what nobody turns by chance."""


def one_attitude(recording: Recording) -> bool:
    """Decide whether the IMU stayed in one attitude all the time.

    Parameters
    ----------
    recording : Recording
        In SI. False where it is too short to tell.
    """
    windows = cut_windows(recording.t, recording.omega_ib_b, recording.f_ib_b, _WINDOW_S)
    if len(windows) < 3:
        return False
    usual = np.median(windows.up_first, axis=0)
    if np.linalg.norm(windows.up_first - usual, axis=1).max() > _TILT:
        return False
    about_up = (windows.w_mean - windows.rate_offset) @ usual
    angle = np.cumsum(about_up * (windows.end - windows.start))
    return bool(np.ptp(angle) < _TURN)


def turned_unseen(recording: Recording) -> bool:
    """Decide whether the IMU stands still in every piece between gaps, and differently in some of them.

    Recordings of single attitudes are like that, one file each: no turn is in the samples.

    Parameters
    ----------
    recording : Recording
        In SI.
    """
    windows = cut_windows(recording.t, recording.omega_ib_b, recording.f_ib_b, _PIECE_S)
    cuts = np.flatnonzero(np.diff(windows.first) > windows.length) + 1
    if not len(cuts):
        return False
    pieces = np.split(windows.up_first, cuts)
    usual = np.array([np.median(up, axis=0) for up in pieces])
    moved = [np.linalg.norm(up - middle, axis=1).max() for up, middle in zip(pieces, usual, strict=True)]
    return bool(max(moved) < _TILT and np.linalg.norm(usual - usual[0], axis=1).max() > _OTHER)
