"""Nonlinearity of an accelerometer along its own input axis.

Source: the model equation of IEEE Std 1293 (single-axis accelerometers): E/K1 = K0 + K0'/2 sgn(a) + (1 + K1'/2
sgn(a)) a + Koq a|a| + K2 a^2 + K3 a^3 + ..., a in g.
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.effects.effect import ACCEL, Excitation, per_axis_columns
from sdimu_calibration.core.effects.registry import register_family
from sdimu_calibration.core.units import STANDARD_GRAVITY

_OBLIQUE = frozenset({Excitation.OBLIQUE_STOPS})

QUADRATIC = register_family(
    "accel_quadratic",
    "accelerometer second-order nonlinearity K2",
    "df_i = K2_i a_i^2",
    per_axis_columns(ACCEL, lambda m: m.a**2),
    ("m/s^2/g^2", "ug/g^2"),
    (20, 100, 2000),
    excitation=_OBLIQUE,
    sheet="second-order nonlinearity",
    typical="navigation 5-30, tactical 50-200, MEMS 500-5000 ug/g^2",
    description="Output bends with the square of the force. At the stops it hides in the bias; the velocity jump after "
    "turns that move the axis shows it.",
    confused_with=("accel_scale_asymmetry", "accel_bias"),
)

SCALE_ASYMMETRY = register_family(
    "accel_scale_asymmetry",
    "accelerometer scale-factor asymmetry K1'",
    "df_i = K1'_i |f_i|",
    per_axis_columns(ACCEL, lambda m: np.abs(m.f)),
    ("1", "ppm"),
    (25, 150, 1500),
    excitation=_OBLIQUE,
    sheet="scale-factor asymmetry",
    typical="navigation 5-50, tactical 50-300, MEMS 500-3000 ppm",
    description="Different scale factors for positive and negative force.",
    confused_with=("accel_quadratic",),
)

CUBIC = register_family(
    "accel_cubic",
    "accelerometer third-order nonlinearity K3",
    "df_i = K3_i a_i^3",
    per_axis_columns(ACCEL, lambda m: m.a**3),
    ("m/s^2/g^3", "ug/g^3"),
    (10, 50, 500),
    excitation=_OBLIQUE,
    sheet="third-order nonlinearity",
    typical="navigation 0.5-10, tactical 10-50, MEMS 50-1000 ug/g^3",
    description="At the stops identical to scale factor; only the velocity over a turn shows it.",
    confused_with=("accel_odd_quadratic", "accel_bias_asymmetry", "accel_scale"),
)

ODD_QUADRATIC = register_family(
    "accel_odd_quadratic",
    "accelerometer odd quadratic Koq",
    "df_i = Koq_i a_i |a_i|",
    per_axis_columns(ACCEL, lambda m: m.a * np.abs(m.a)),
    ("m/s^2/g^2", "ug/g^2"),
    (10, 50, 500),
    excitation=_OBLIQUE,
    sheet="odd quadratic nonlinearity",
    typical="navigation 1-10, tactical 10-50, MEMS 50-500 ug/g^2",
    description="Square law with the sign of the force. In a rate-table test one class with K3.",
    confused_with=("accel_cubic", "accel_bias_asymmetry", "accel_scale"),
)

_SIGN_WIDTH = 1e-3
"""Force over which the step of sgn is spread (g): a turn at 2 deg/s crosses it within one cycle of navigation."""

BIAS_ASYMMETRY = register_family(
    "accel_bias_asymmetry",
    "accelerometer bias asymmetry K0'",
    "df_i = K0'_i sgn(a_i)",
    per_axis_columns(ACCEL, lambda m: np.tanh(m.f / (_SIGN_WIDTH * STANDARD_GRAVITY))),
    ("m/s^2", "ug"),
    (5, 20, 200),
    excitation=_OBLIQUE,
    typical="navigation below 5, tactical below 20 ug",
    description="Bias that changes with the sign of the force.",
    confused_with=("accel_cubic", "accel_odd_quadratic", "accel_scale"),
)
