"""Gyro error that is not linear in the rate, or follows its change."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import AXES, GYRO, Excitation, matrix_columns, per_axis_columns, product
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.effects.registry import register_family


def _rate(motion: Motion) -> Floats:
    return motion.w


SCALE_ASYMMETRY = register_family(
    "gyro_scale_asymmetry",
    "gyro scale-factor asymmetry",
    "dw_i = k_i |w_i|",
    per_axis_columns(GYRO, lambda m: np.abs(m.w)),
    ("1", "ppm"),
    (25, 100, 500),
    excitation=frozenset({Excitation.BOTH_SENSES, Excitation.TWO_RATES}),
    sheet="scale-factor asymmetry",
    typical="DTG 5-50, FOG 1-20, tactical 20-200, MEMS 50-1000 ppm",
    description="Different scale factors for both senses of turn. Needs turns of both signs; at one rate the same as "
    "the quadratic term.",
    confused_with=("gyro_scale_quadratic",),
)

SCALE_QUADRATIC = register_family(
    "gyro_scale_quadratic",
    "gyro scale-factor nonlinearity, second order",
    "dw_i = k_i w_i^2",
    per_axis_columns(GYRO, lambda m: m.w**2),
    ("s/rad", "ppm*s/deg"),
    (10, 50, 200),
    excitation=frozenset({Excitation.BOTH_SENSES, Excitation.TWO_RATES}),
    sheet="scale-factor nonlinearity, second order",
    typical="5-100 ppm of full scale",
    description="Grows with the square of the rate. Two rates separate it from the asymmetry.",
    confused_with=("gyro_scale_asymmetry",),
)

SCALE_CUBIC = register_family(
    "gyro_scale_cubic",
    "gyro scale-factor nonlinearity, third order",
    "dw_i = k_i w_i^3",
    per_axis_columns(GYRO, lambda m: m.w**3),
    ("s^2/rad^2", "ppm*s^2/deg^2"),
    (0.1, 0.5, 2),
    excitation=frozenset({Excitation.TWO_RATES}),
    sheet="scale-factor nonlinearity, third order",
    typical="10-200 ppm at 10 deg/s",
    description="At one rate the same as the scale factor.",
    confused_with=("gyro_scale",),
)

MISALIGNMENT_ASYMMETRY = register_family(
    "gyro_misalignment_asymmetry",
    "gyro misalignment asymmetry",
    "dw_i = k_ij |w_j|",
    matrix_columns(GYRO, lambda m: np.abs(m.w), diagonal=False),
    ("rad", "arcsec"),
    (3, 20, 120),
    excitation=frozenset({Excitation.BOTH_SENSES}),
    typical="0-5 arcsec",
    description="Cross-axis pick-up that does not change sign with the rate.",
    confused_with=("gyro_g_product",),
)

ANISOINERTIA = register_family(
    "gyro_anisoinertia",
    "gyro anisoinertia",
    "dw_i = k_i w_j w_k",
    {AXES[i]: (GYRO[i], product(_rate, (i + 1) % 3, _rate, (i + 2) % 3)) for i in range(3)},
    ("s/rad", "s/rad"),
    (1e-3, 1e-3, 1e-2),
    excitation=frozenset({Excitation.TWO_AXES}),
    typical="instrument dependent",
    description="Product of both cross-axis rates: needs turns about two axes at once.",
)

ACCELERATION = register_family(
    "gyro_acceleration_sensitivity",
    "gyro angular-acceleration sensitivity",
    "dw_i = k_ij alpha_j",
    matrix_columns(GYRO, lambda m: m.alpha),
    ("s", "ms"),
    (1, 2, 5),
    typical="DTG 2-5 ms",
    description="Follows the ramps of the turns; the own-axis term is a delay of the gyro.",
    confused_with=("gyro_delay",),
)
