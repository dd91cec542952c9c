"""Whether a run is one that nothing can be navigated in: moved by a hand, or with gyros that do not see the Earth.

A table turns about one of its axes at a time, whatever the profile of its rate: in the body the axis of a turn stands
still. No hand holds an axis for half a second.
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.data.attitudes import one_attitude, turned_unseen
from sdimu_calibration.core.data.static_detection import hides_earth_rate
from sdimu_calibration.core.data.windows import cut_windows
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.core.specification import ImuSpecification

_WINDOW_S = 0.25
"""Length of a window (s): a hand turns for a second or two, and its tremor (10 Hz) averages out."""
_TURNS = np.radians(0.5)
"""Least mean rate (rad/s) that shows an axis: slower is a drifting bias."""
_NOISE = 20.0
"""Ratio of a mean rate to its noise from which it shows an axis: its direction is then known to 3 deg."""
_STAYS = float(np.cos(np.radians(5.0)))
"""Cosine (1) of the angle between the axes of neighbouring windows below which the axis moved: flexible tables move it
by 2 deg."""
_OF_A_TABLE = 0.6
"""Share of neighbouring windows whose axis stays: tables have .99, hands .1 to .3."""
_FEWEST = 12
"""Number of pairs of windows at least: fewer than three seconds of turning tell nothing."""


def why_handheld(recording: Recording, imu: ImuSpecification) -> str:
    """Say why a run is estimated without navigation; empty when it is navigated.

    Parameters
    ----------
    recording : Recording
        In SI.
    imu : ImuSpecification
        Its noise, beside that of the rests, decides whether the Earth's rate is seen.
    """
    if turned_unseen(recording):
        return "no turn between its attitudes is in the recording"
    if hides_earth_rate(recording, imu):
        # One rest is no run by hand: navigated, it is a part of a set of single attitudes.
        if one_attitude(recording):
            return ""
        return "the gyros' white noise in the usual rest hides the Earth's rate"
    if looks_handheld(recording):
        return "the axis of its turns moves as in a hand, and no table says otherwise"
    return ""


def looks_handheld(recording: Recording) -> bool:
    """Decide whether a hand turned the IMU.

    It did when the axes of the turns move, and no status of a table names a dwell.

    Parameters
    ----------
    recording : Recording
        In SI.
    """
    if recording.phase is not None and recording.phase.dwell.any():
        return False
    windows = cut_windows(recording.t, recording.omega_ib_b, recording.f_ib_b, _WINDOW_S)
    if len(windows) < 2:
        return False
    quiet = windows.quiet
    steps = np.diff(windows.w_mean, axis=0)[quiet[1:] & quiet[:-1]]
    noise = float(np.sqrt(np.median(np.sum(steps**2, axis=1)) / 2.0)) if len(steps) else 0.0
    w = windows.w_mean - windows.rate_offset
    size = np.linalg.norm(w, axis=1)
    turns = size > max(_TURNS, _NOISE * noise)
    pairs = (np.diff(windows.first) == windows.length) & turns[1:] & turns[:-1]
    if np.count_nonzero(pairs) < _FEWEST:
        return False
    cosine = np.abs(np.sum(w[1:] * w[:-1], axis=1))[pairs] / (size[1:] * size[:-1])[pairs]
    return bool(np.mean(cosine > _STAYS) < _OF_A_TABLE)
