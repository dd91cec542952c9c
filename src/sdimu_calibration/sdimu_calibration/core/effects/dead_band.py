"""Dead band, dead zone, lock-in: small rates are swallowed."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import GYRO, per_axis_columns
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.effects.registry import register_family

_WIDTH = 0.01 * earth.RATE
"""Rate over which the step of sgn is spread (rad/s): at a few per cent of the Earth's rate noise decides the sign."""


def _sign(motion: Motion) -> Floats:
    return np.asarray(-np.tanh(motion.w / _WIDTH))


DEAD_BAND = register_family(
    "gyro_dead_band",
    "gyro dead band (dead zone, lock-in residual)",
    "dw_i = -d_i sgn(w_i), |w_i| > d_i",
    per_axis_columns(GYRO, _sign),
    ("rad/s", "deg/h"),
    (0.02, 0.05, 1),
    typical="DTG 0.001-0.01, RLG residual, MEMS none (deg/h)",
    description="The gyro stands still below a rate and is short by it above. Its sign at stops where an axis points "
    "East-West hangs on noise.",
    confused_with=("gyro_magnetic", "gyro_lock_in"),
)
