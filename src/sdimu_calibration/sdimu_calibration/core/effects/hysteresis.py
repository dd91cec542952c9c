"""Hysteresis: the output remembers from which side the present state was reached."""

from __future__ import annotations

from sdimu_calibration.core.effects.effect import ACCEL, GYRO, per_axis_columns
from sdimu_calibration.core.effects.registry import register_family

GYRO_HYSTERESIS = register_family(
    "gyro_hysteresis",
    "gyro hysteresis (remanence)",
    "dw_i = h_i sgn(last turn about i)",
    per_axis_columns(GYRO, lambda m: m.turned),
    ("rad/s", "deg/h"),
    (0.02, 0.1, 2),
    typical="below 0.01 deg/h",
    description="Bias that depends on the sense of the last turn. Needs turns of both signs. The sign switches "
    "when the rate about the axis exceeds 0.5 deg/s: a smaller share of a turn about another axis leaves it.",
    confused_with=("gyro_creep",),
)

ACCEL_HYSTERESIS = register_family(
    "accel_hysteresis",
    "accelerometer hysteresis",
    "df_i = h_i sgn(last change of a_i)",
    per_axis_columns(ACCEL, lambda m: m.leant),
    ("m/s^2", "ug"),
    (20, 50, 500),
    typical="navigation 5-50, MEMS 50-1000 ug",
    description="Bias that depends on the side from which the force was reached. The sign switches when the force "
    "along the axis changes faster than 8.7 mg/s, as 1 g across it does at 0.5 deg/s, however little it changes in "
    "all; with a memory of how far it changed it is play.",
    confused_with=("accel_scale", "accel_play", "accel_creep"),
)
