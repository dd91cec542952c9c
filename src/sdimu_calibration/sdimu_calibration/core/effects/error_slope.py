"""Change of the sensor errors with what the sensors see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.effects.imu_model import ImuModel, errors_along
from sdimu_calibration.core.effects.motion import NO_PAST, Motion

_STEP = (1e-9, 1e-6)
"""Steps of rate (rad/s) and force (m/s^2) for derivatives: below every threshold of an effect."""


def error_slope(model: ImuModel, seen: Motion, rows: slice | Ints, coefficients: Floats) -> Floats:
    """Change of the sensor errors per change of what the sensors see, by forward differences.

    With errors of percents it is percents too, and Gauss-Newton needs it: the three rotations of the body frame, which
    only priors hold, feel every inconsistency between the derivatives. At rest the rate of the table stays zero, as it
    is known to be; in motion it changes with the body rate.

    Parameters
    ----------
    seen : Motion
        n cycles.
    rows : slice or ndarray of int, shape (r,)
        Cycles at which the slope is wanted.
    coefficients : ndarray, shape (p,)
        SI.

    Returns
    -------
    ndarray, shape (r, 6, 6)
        Change of the error of sensor axis i (row) per change of true rate or force j (column): 0-2 rate (rad/s), 3-5
        force (m/s^2), in b.
    """
    at = _at(seen, rows)
    slope = np.zeros((len(at.t), 6, 6))
    sized = model.sized(coefficients)
    steady = [(effect, to_axes) for effect, to_axes in sized if effect.linear]
    if steady and len(at.t):
        # Any step is right for what is linear, and a large one leaves no rounding.
        slope += _slope(steady, _at(at, slice(0, 1)), (1.0, 1.0))
    other = [(effect, to_axes) for effect, to_axes in sized if not effect.linear]
    if other:
        slope += _slope(other, at, _STEP)
    return slope


def slope_is_constant(model: ImuModel, coefficients: Floats) -> bool:
    """Tell whether `error_slope` has equal rows: all effects that have a coefficient are linear.

    Parameters
    ----------
    coefficients : ndarray, shape (p,)
        SI.
    """
    return all(effect.linear for effect, _ in model.sized(coefficients))


def _slope(sized: Sequence[tuple[Effect, Floats]], at: Motion, steps: tuple[float, float]) -> Floats:
    """Forward differences of errors, shape (n, 6, 6), with `steps` of rate (rad/s) and force (m/s^2)."""
    before = errors_along(sized, at)
    slope = np.empty((len(before), 6, 6))
    moving = np.where(at.rest, 0.0, 1.0)[:, None]
    for i in range(6):
        step = np.zeros(6)
        step[i] = steps[i // 3]
        moved = replace(at, w=at.w + step[:3], f=at.f + step[3:], w_table=at.w_table + moving * step[:3])
        slope[:, :, i] = (errors_along(sized, moved) - before) / step[i]
    return slope


def _at(seen: Motion, rows: slice | Ints) -> Motion:
    """Rows of a motion, without the past.

    What an effect remembers is shifted with everything else then, and only a change of the present counts.
    """
    n = len(seen.t)
    columns = {f.name: getattr(seen, f.name) for f in fields(seen)} | {"past": NO_PAST}
    return Motion(**{name: v[rows] if len(v) == n else v for name, v in columns.items()})
