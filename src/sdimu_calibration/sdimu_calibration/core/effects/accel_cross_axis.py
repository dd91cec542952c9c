"""Accelerometer error from force across the input axis. Source: IEEE Std 1293 terms Kip, Kio, Kpp, Koo, Kpo."""

from __future__ import annotations

from collections.abc import Callable

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import ACCEL, AXES, Column, Excitation, matrix_columns
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.effects.registry import register_family


def _coupling(i: int, j: int) -> Column:
    return lambda m: m.a[:, i] * m.a[:, j]


def _square(m: Motion) -> Floats:
    return m.a**2


_COUPLING = {AXES[i] + AXES[j]: (ACCEL[i], _coupling(i, j)) for i in range(3) for j in range(3) if i != j}
_PRODUCT = {AXES[i]: (ACCEL[i], _coupling((i + 1) % 3, (i + 2) % 3)) for i in range(3)}
_SQUARE: Callable[[Motion], Floats] = _square

CROSS_COUPLING = register_family(
    "accel_cross_coupling",
    "accelerometer cross-coupling Kip, Kio",
    "df_i = K_ij a_i a_j",
    _COUPLING,
    ("m/s^2/g^2", "ug/g^2"),
    (20, 100, 1500),
    excitation=frozenset({Excitation.OBLIQUE_STOPS}),
    sheet="cross-axis nonlinearity",
    typical="navigation 5-30, tactical 50-200, MEMS 500-3000 ug/g^2",
    description="Product of the forces along and across the input axis. Zero at cardinal stops; a velocity jump after "
    "turns that sweep the plane of both.",
    confused_with=("accel_triad_flexure",),
)

CROSS_SQUARE = register_family(
    "accel_cross_square",
    "accelerometer cross-axis square Kpp, Koo",
    "df_i = K_jj a_j^2",
    matrix_columns(ACCEL, _SQUARE, diagonal=False),
    ("m/s^2/g^2", "ug/g^2"),
    (10, 60, 1000),
    typical="navigation below 10, tactical 20-100, MEMS 200-2000 ug/g^2",
    description="Square of a force across the input axis. With the own-axis square the three sum to a bias.",
    confused_with=("accel_quadratic", "accel_bias", "accel_triad_flexure"),
)

CROSS_PRODUCT = register_family(
    "accel_cross_product",
    "accelerometer cross-axis product Kpo",
    "df_i = K_jk a_j a_k",
    _PRODUCT,
    ("m/s^2/g^2", "ug/g^2"),
    (10, 60, 500),
    excitation=frozenset({Excitation.OBLIQUE_STOPS}),
    typical="navigation below 10, tactical 20-100 ug/g^2",
    description="Product of both forces across the input axis; acts in turns about the input axis.",
    confused_with=("accel_triad_flexure",),
)
