"""Change of the sensor errors with what the sensors see."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.effects.imu_model import ImuModel
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
    if not coefficients.any():
        # Errors are columns times coefficients: regressors at seven steps would give the same zeros.
        return np.zeros((len(at.t), 6, 6))
    before = model.errors(model.regressors(at), coefficients)
    slope = np.empty((len(before), 6, 6))
    moving = np.where(at.rest, 0.0, 1.0)[:, None]
    for i in range(6):
        step = np.zeros(6)
        step[i] = _STEP[i // 3]
        moved = replace(at, w=at.w + step[:3], f=at.f + step[3:], w_table=at.w_table + moving * step[:3])
        slope[:, :, i] = (model.errors(model.regressors(moved), coefficients) - before) / step[i]
    return slope


def _at(seen: Motion, rows: slice | Ints) -> Motion:
    """Rows of a motion, without the past.

    What an effect remembers is shifted with everything else then, and only a change of the present counts.
    """
    n = len(seen.t)
    columns = {f.name: getattr(seen, f.name) for f in fields(seen)} | {"past": NO_PAST}
    return Motion(**{name: v[rows] if len(v) == n else v for name, v in columns.items()})
