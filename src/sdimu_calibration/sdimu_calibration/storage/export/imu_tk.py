"""The .calib files of imu_tk, one a triad.

imu_tk (A. Pretto; Tedaldi, Pretto & Menegatti, "A robust and easy to implement method for IMU calibration without
external equipments", ICRA 2014)
corrects a triad by ``T K (raw - B)``: misalignment T with ones on its diagonal, scale K a diagonal, bias B. Its reader
takes the first 21 numbers of the file (T and K row by row, then B), so what else is to be said stands behind them.
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.compensation import LinearModel
from sdimu_calibration.storage.export import shared
from sdimu_calibration.storage.export.shared import Source, by_force, comments, row


def texts(source: Source) -> dict[str, str]:
    """Return the texts of the files of both triads."""
    linear = source.linear
    return {
        "-accel": _text(source, linear.accel, linear.accel_bias, "Accelerometers, m/s^2."),
        "-gyro": _text(source, linear.gyro, linear.gyro_bias, "Gyros, rad/s."),
    }


def _text(source: Source, matrix: Floats, bias: Floats, title: str) -> str:
    inverse = np.linalg.inv(matrix)
    K = np.diag(np.diag(inverse))
    T = inverse / np.diag(inverse)
    blocks = [*map(row, T), "", *map(row, K), "", *(row(np.array([b])) for b in bias), ""]
    remarks = [f"# {title} Corrected = T K (raw - B), T and K above, then B.", *comments(source, "#")]
    return "\n".join([*blocks, *remarks]) + "\n"


def cannot_hold(linear: LinearModel) -> list[str]:
    """Say what is left out: the gyros' sensitivity to force has no place in the form."""
    return by_force(linear) + shared.cannot_hold(linear)
