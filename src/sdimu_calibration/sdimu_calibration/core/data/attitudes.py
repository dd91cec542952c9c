"""Whether a recording shows more than one attitude: from one alone no estimator tells a coefficient from another."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.data.windows import cut_windows
from sdimu_calibration.core.recording import Recording

_WINDOW_S = 4.0
"""Length of a window (s): longer than the rocking of a building, a ship or a foundation."""
_TILT = np.radians(3.0)
"""Largest change of the direction of gravity (rad) that is no other attitude: what a base that rocks does."""
_TURN = np.radians(5.0)
"""Largest angle turned about the vertical (rad) that is no other attitude: what a drift of the gyros looks like."""


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
