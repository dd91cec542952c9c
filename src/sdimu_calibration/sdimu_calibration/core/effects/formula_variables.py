"""What the names of a formula (`core.expression.VARIABLES`) are in the motion that the effects see."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import AXES, Column, pick
from sdimu_calibration.core.effects.motion import Motion


def _axes(stem: str, of: Callable[[Motion], Floats]) -> dict[str, Column]:
    return {stem + axis: pick(of, i) for i, axis in enumerate(AXES)}


VALUES: dict[str, Column] = {
    **_axes("w", lambda m: m.w),
    **_axes("wt", lambda m: m.w_table),
    **_axes("alpha", lambda m: m.alpha),
    **_axes("a", lambda m: m.a),
    **_axes("f", lambda m: m.f),
    **_axes("n", lambda m: np.asarray(m.C_nb[:, 0, :])),
    **_axes("e", lambda m: np.asarray(m.C_nb[:, 1, :])),
    **_axes("d", lambda m: np.asarray(m.C_nb[:, 2, :])),
    **_axes("turned", lambda m: m.turned),
    **_axes("leant", lambda m: m.leant),
    "moving": lambda m: m.moving,
    "t": lambda m: m.t - 0.5 * m.dt,
    "T": lambda m: m.temperature,
    "dTdt": lambda m: m.temperature_rate,
}
"""Value of each name, ``Motion -> ndarray (n,)``, in the unit that `VARIABLES` states."""
