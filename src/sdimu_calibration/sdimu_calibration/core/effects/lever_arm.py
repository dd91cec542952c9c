"""The accelerometers do not sit at the point that stands still."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import ACCEL, AXES, REFERENCES, Effect, Parameter, Term, pick
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.effects.registry import register, register_family

SIZE = register_family(
    "accel_size",
    "size effect (inner lever arm)",
    "df_i = [(alpha x + w x w x) r_i]_i",
    {AXES[i] + AXES[j]: (ACCEL[i], pick(lambda m: m.lever, i, j)) for i in range(3) for j in range(3)},
    ("m", "mm"),
    (20, 20, 20),
    typical="5-50 mm",
    description="Each accelerometer has its own place. Grows with the square of the rate: fast turns show it. A common "
    "place of all three is a lever arm and moves only the position.",
    confused_with=("accel_bias_in_motion", "accel_rate_sensitivity"),
)


def _lever(motion: Motion) -> Floats:
    return np.ascontiguousarray(motion.lever.reshape(len(motion.t), 9))


LEVER_ARM = register(
    Effect(
        name="lever_arm",
        title="lever arm from the table's axes to the IMU",
        equation="df = (alpha x + w x w x) r",
        parameters=tuple(Parameter(f"lever_arm_{a}", "m", "mm") for a in AXES),
        terms=tuple(Term(ACCEL[i], j) for i in range(3) for j in range(3)),
        regressors=_lever,
        prior={"navigation": 0.1, "tactical": 0.1, "mems": 0.1},
        group=REFERENCES,
        scope="setup",
        description="The IMU really moves when the table turns. Not a sensor error; seen as an error because the "
        "filter holds the IMU at one point.",
        typical="1-300 mm",
        confused_with=("accel_size",),
    )
)
