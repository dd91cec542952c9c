"""Gyro drift by specific force beyond the mass unbalance of the baseline. Source: IEEE Std 813 (DTG): D_x ... D_xz."""

from __future__ import annotations

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import AXES, GYRO, Excitation, matrix_columns, product
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.effects.registry import register_family

_PAIRS = ((0, 1), (0, 2), (1, 2))


def _force(motion: Motion) -> Floats:
    return motion.a


G_SENSITIVITY = register_family(
    "gyro_g_sensitivity",
    "gyro g-sensitivity, full matrix",
    "dw_i = D_ij a_j",
    matrix_columns(GYRO, lambda m: m.a),
    ("rad/s/g", "deg/h/g"),
    (0.3, 1, 50),
    linear=True,
    sheet="g-sensitivity",
    typical="DTG spin axis 0.05-0.5, optical below 0.1, tactical 0.1-1, MEMS 1-100 deg/h/g",
    description="Drift in proportion to force along any axis. Six of nine are the mass unbalance of the baseline; "
    "those of the spin axes (xz, yz, zx) are not.",
    parts={f"gyro_g_sensitivity_{ij}": "gyro_mass_unbalance" for ij in ("xx", "xy", "yy", "yx", "zz", "zy")},
    confused_with=("gyro_mass_unbalance",),
)

G_SQUARED = register_family(
    "gyro_g_squared",
    "gyro g-squared drift (anisoelastic), squares",
    "dw_i = D_ijj a_j^2",
    matrix_columns(GYRO, lambda m: m.a**2),
    ("rad/s/g^2", "deg/h/g^2"),
    (0.03, 0.1, 3),
    sheet="g-squared sensitivity",
    typical="DTG 0.005-0.05, tactical 0.05-0.2, MEMS 0.1-3 deg/h/g^2",
    description="Suspension of unequal stiffness. The three squares of one gyro sum to a bias.",
    confused_with=("gyro_bias", "gyro_g_dependent_scale"),
)

G_PRODUCT = register_family(
    "gyro_g_product",
    "gyro g-squared drift (anisoelastic), products",
    "dw_i = D_ijk a_j a_k",
    {AXES[i] + AXES[j] + AXES[k]: (GYRO[i], product(_force, j, _force, k)) for i in range(3) for j, k in _PAIRS},
    ("rad/s/g^2", "deg/h/g^2"),
    (0.03, 0.1, 3),
    excitation=frozenset({Excitation.OBLIQUE_STOPS}),
    sheet="g-squared sensitivity",
    typical="DTG 0.005-0.05, tactical 0.05-0.2, MEMS 0.1-3 deg/h/g^2",
    description="Zero at cardinal stops; little time in turns. Stops at 45 deg make it visible.",
    confused_with=("gyro_misalignment_asymmetry",),
)

G_DEPENDENT_SCALE = register_family(
    "gyro_g_dependent_scale",
    "gyro g-dependent scale factor",
    "dw_i = k_i a_i w_i",
    {AXES[i]: (GYRO[i], product(_force, i, lambda m: m.w, i)) for i in range(3)},
    ("1/g", "ppm/g"),
    (10, 100, 1000),
    typical="small",
    description="Scale factor that changes with the force along the axis.",
    confused_with=("gyro_g_squared",),
)
