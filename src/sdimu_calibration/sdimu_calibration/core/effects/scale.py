"""Scale-factor error of each sensor."""

from __future__ import annotations

from sdimu_calibration.core.effects.effect import ACCEL, BASELINE, GYRO, Effect, own_axis, per_axis
from sdimu_calibration.core.effects.registry import register
from sdimu_calibration.core.units import to_si

_PRIOR = {"navigation": to_si(150, "ppm"), "tactical": to_si(500, "ppm"), "mems": to_si(2, "%")}

GYRO_SCALE = register(
    Effect(
        name="gyro_scale",
        title="gyro scale-factor error",
        sheet="scale-factor error",
        equation="dw_i = T_i w_i",
        parameters=per_axis("gyro_scale", "1", "ppm"),
        terms=own_axis(GYRO),
        regressors=lambda motion: motion.w,
        prior=_PRIOR,
        description="Relative error of the gyro's output per unit of rate. Seen in turns, not at rest.",
        typical="navigation 5-150, tactical 100-500, MEMS 1000-30000 ppm",
        group=BASELINE,
        linear=True,
    )
)

ACCEL_SCALE = register(
    Effect(
        name="accel_scale",
        title="accelerometer scale-factor error",
        sheet="scale-factor error",
        equation="df_i = K_i f_i",
        parameters=per_axis("accel_scale", "1", "ppm"),
        terms=own_axis(ACCEL),
        regressors=lambda motion: motion.f,
        prior=_PRIOR,
        description="Relative error of the accelerometer's output per unit of specific force. A wrong value of gravity "
        "looks the same on all three axes.",
        typical="navigation 10-150, tactical 100-500, MEMS 1000-30000 ppm",
        group=BASELINE,
        linear=True,
    )
)
