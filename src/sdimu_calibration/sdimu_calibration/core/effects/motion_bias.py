"""Bias while the table turns: vibration rectification, interference from the drive."""

from __future__ import annotations

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import ACCEL, GYRO, Excitation, per_axis_columns
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.effects.registry import register_family


def _moving(motion: Motion) -> Floats:
    return motion.moving[:, None].repeat(3, axis=1)


GYRO_BIAS_IN_MOTION = register_family(
    "gyro_bias_in_motion",
    "gyro bias in motion",
    "dw_i = k_i while the table turns",
    per_axis_columns(GYRO, _moving),
    ("rad/s", "deg/h"),
    (0.1, 1, 20),
    excitation=frozenset({Excitation.BOTH_SENSES}),
    typical="0.01-0.2 deg/h",
    description="Vibration and electromagnetic interference of the drive. Needs turns of both signs.",
    confused_with=("gyro_scale", "gyro_scale_asymmetry"),
)

ACCEL_BIAS_IN_MOTION = register_family(
    "accel_bias_in_motion",
    "accelerometer bias in motion (vibration rectification)",
    "df_i = k_i while the table turns",
    per_axis_columns(ACCEL, _moving),
    ("m/s^2", "ug"),
    (20, 100, 1000),
    typical="10-50 ug/g^2rms times the level",
    description="Vibration of the drive rectified by the nonlinearity of the accelerometer.",
    confused_with=("accel_size", "accel_rate_sensitivity"),
)
