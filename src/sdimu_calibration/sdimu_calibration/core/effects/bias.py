"""Constant bias of each sensor."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import ACCEL, BASELINE, GYRO, Effect, own_axis, per_axis
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.effects.registry import register
from sdimu_calibration.core.units import to_si


def _ones(motion: Motion) -> Floats:
    return np.ones((len(motion.t), 3))


GYRO_BIAS = register(
    Effect(
        name="gyro_bias",
        title="gyro bias (g-insensitive drift)",
        sheet="bias",
        equation="dw_i = b_i",
        parameters=per_axis("gyro_bias", "rad/s", "deg/h"),
        terms=own_axis(GYRO),
        regressors=_ones,
        prior={"navigation": to_si(1, "deg/h"), "tactical": to_si(10, "deg/h"), "mems": to_si(1, "deg/s")},
        description="What the gyro shows at rest against inertial space, free of specific force.",
        typical="navigation 0.005-1, tactical 1-10, MEMS 10-4000 deg/h",
        group=BASELINE,
        linear=True,
        scope="power-on",
        confused_with=("gyro_mass_unbalance",),
    )
)

ACCEL_BIAS = register(
    Effect(
        name="accel_bias",
        title="accelerometer bias",
        sheet="bias",
        equation="df_i = B_i",
        parameters=per_axis("accel_bias", "m/s^2", "ug"),
        terms=own_axis(ACCEL),
        regressors=_ones,
        prior={"navigation": to_si(150, "ug"), "tactical": to_si(1, "mg"), "mems": to_si(50, "mg")},
        description="What the accelerometer shows without specific force along its input axis.",
        typical="navigation 20-150, tactical 200-1000, MEMS 1000-50000 ug",
        group=BASELINE,
        linear=True,
        scope="power-on",
    )
)

NAMES = tuple(p.name for effect in (GYRO_BIAS, ACCEL_BIAS) for p in effect.parameters)
"""Name of the bias of each sensor, in the order of the channels."""
