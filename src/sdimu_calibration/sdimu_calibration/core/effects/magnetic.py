"""Magnetic sensitivity: the field of the site turns with the attitude."""

from __future__ import annotations

from sdimu_calibration.core.effects.effect import ACCEL, GYRO, matrix_columns
from sdimu_calibration.core.effects.registry import register_family

GYRO_MAGNETIC = register_family(
    "gyro_magnetic",
    "gyro magnetic sensitivity",
    "dw_i = m_ij B_j",
    matrix_columns(GYRO, lambda m: m.field),
    ("rad/s/T", "deg/h/G"),
    (0.1, 0.5, 5),
    needs="magnetic",
    typical="DTG 0.005-0.1, FOG 0.02-1 unshielded, RLG 0.002-0.05 deg/h/G",
    description="Drift in proportion to the Earth's field in the body frame.",
    confused_with=("gyro_g_sensitivity", "gyro_dead_band", "gyro_lock_in", "gyro_misalignment"),
)

ACCEL_MAGNETIC = register_family(
    "accel_magnetic",
    "accelerometer magnetic sensitivity",
    "df_i = m_ij B_j",
    matrix_columns(ACCEL, lambda m: m.field),
    ("m/s^2/T", "ug/G"),
    (20, 50, 500),
    needs="magnetic",
    typical="1-20 ug/G",
    description="Error in proportion to the Earth's field. Along the own axis it is a misalignment or a scale factor.",
    confused_with=("accel_scale", "accel_misalignment"),
)
