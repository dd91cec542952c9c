"""Bias that follows the angle turned since the start: twisted cables, slip rings that wind up."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import ACCEL, GYRO, matrix_columns
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.effects.registry import register_family


def _turns(motion: Motion) -> Floats:
    """Count the turns about each body axis since the start, with their sense, shape (n, 3)."""
    return np.asarray(motion.wound / (2.0 * np.pi))


GYRO_WRAP = register_family(
    "gyro_bias_wrap",
    "gyro bias by cable wrap",
    "dw_i = k_ij N_j, N_j: turns about body axis j since the start",
    matrix_columns(GYRO, _turns),
    ("rad/s", "deg/h"),
    (0.02, 0.1, 2),
    scope="setup",
    needs_table=True,
    wander_like=True,
    shifts_bias=True,
    typical="0.005-0.05 deg/h per turn",
    description="Torque and interference of cables that the turns twist. Turned back, it is gone: drift in time "
    "stays. Where all turns have one sense it grows in steps like a drift.",
    confused_with=("gyro_bias_ramp", "gyro_bias_random_walk", "gyro_bias_step"),
)

ACCEL_WRAP = register_family(
    "accel_bias_wrap",
    "accelerometer bias by cable wrap",
    "df_i = k_ij N_j, N_j: turns about body axis j since the start",
    matrix_columns(ACCEL, _turns),
    ("m/s^2", "ug"),
    (5, 20, 200),
    scope="setup",
    needs_table=True,
    wander_like=True,
    shifts_bias=True,
    typical="1-10 ug per turn",
    description="Stress and interference of cables that the turns twist. Turned back, it is gone: drift in time stays.",
    confused_with=("accel_bias_ramp", "accel_bias_random_walk", "accel_bias_step"),
)
