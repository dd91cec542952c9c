"""Whole turns about the vertical: the one kind of turn whose angle a person at a desk knows.

Gravity does not show a turn about itself. Who puts the IMU back where it was, against an edge, knows that it turned by
a multiple of 360 deg, and the gyros' scale factors follow (Ferraris, Grimaldi & Parvis, "Procedure for effortless
in-field calibration of three-axial rate gyro and accelerometers", Sensors and Materials 7, 1995).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sdimu_calibration.core.arrays import Ints
from sdimu_calibration.core.handheld.handheld_data import HandheldRun
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.wording import Option

_SAME_SIDE = np.radians(5.0)
"""Largest angle between the forces before and after (rad): the same side lies on the desk."""
_OFF = 0.1
"""Largest share of a whole turn that the uncorrected gyros may miss it by: scale factors err by less."""
_UPRIGHT = 0.8
"""Least share of the way that is about the vertical: a desk under the IMU holds the axis, a hand does not."""


def whole_turns(run: HandheldRun) -> Ints:
    """Find the turns that may be whole ones about the vertical: which of the k - 1, shape (w,).

    Parameters
    ----------
    run : HandheldRun
        With k rests.
    """
    up = run.mean[:, 3:] / np.linalg.norm(run.mean[:, 3:], axis=1, keepdims=True)
    bias = np.median(run.mean[:, :3], axis=0)
    found = []
    for i in np.flatnonzero(~run.unseen & (np.linalg.norm(np.diff(up, axis=0), axis=1) < _SAME_SIDE)):
        rows = slice(run.first[i], run.last[i])
        angle = float(((run.cycles.alpha[rows] - run.cycles.dt[rows, None] * bias) @ up[i]).sum())
        whole = 2.0 * np.pi * round(angle / (2.0 * np.pi))
        if whole and abs(angle - whole) < _OFF * 2.0 * np.pi and abs(angle) > _UPRIGHT * run.path[i]:
            found.append(int(i))
    return np.array(found, dtype=np.int64)


def with_whole_turns(run: HandheldRun, sigma: float) -> HandheldRun:
    """Return a run whose whole turns are known to be such. `sigma`: how well the IMU was put back (rad, one sigma)."""
    found = whole_turns(run)
    if not len(found):
        raise DataError(
            f"/imu/data_raw: {Option.WHOLE_TURNS}: no turn about the vertical comes near a multiple of 360 deg, with "
            "rests on the same side before and after it"
        )
    return replace(run, whole=found, whole_sigma=sigma)
