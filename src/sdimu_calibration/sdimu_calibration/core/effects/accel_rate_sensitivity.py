"""Accelerometer error in proportion to the rate of turn: pick-up from the gyros and the drive, Coriolis forces."""

from __future__ import annotations

from sdimu_calibration.core.effects.effect import ACCEL, matrix_columns
from sdimu_calibration.core.effects.registry import register_family

RATE_SENSITIVITY = register_family(
    "accel_rate_sensitivity",
    "accelerometer rate sensitivity",
    "df_i = k_ij wt_j, wt: rate against the Earth",
    matrix_columns(ACCEL, lambda m: m.w_table),
    ("m/s^2*s/rad", "ug*s/deg"),
    (10, 30, 300),
    typical="navigation below 5, MEMS 10-100 ug*s/deg",
    description="A velocity jump in proportion to the angle of each turn, with its sense. A proof mass that "
    "vibrates feels the Coriolis force; loops of gyros and drive couple electrically.",
    confused_with=("accel_bias_in_motion", "accel_size"),
)
