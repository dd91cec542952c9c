"""Exact correction of cycles: what a perfect IMU would have measured.

`track.motion` compensates in rounds, each of which leaves an error smaller by a factor of the size of the sensor
errors; with sensor errors of percents three rounds leave 4e-5 of the rate. One Newton step from there, with the slope S
of the sensor errors, is exact for errors that are linear in rate and force:

    measured = true + error(true)   ->   true = seen + (I + S)^-1 (measured - seen - error(seen)).

The same (I + S)^-1 maps small changes of the coefficients, and noise, to corrected samples.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.effects.error_slope import error_slope, slope_is_constant
from sdimu_calibration.core.effects.imu_model import ImuModel, errors_along
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.navigation.strapdown import Cycles


@dataclass(frozen=True)
class CorrectedCycles:
    """Cycles without the sensor errors."""

    cycles: Cycles
    seen: Motion
    """Its rate and force are those of the corrected cycles."""
    weight: Floats
    """Shape (n, 6, 6). ``(I + S)^-1``: change of true rate and force per change of the measured ones."""


def correct_cycles(cycles: Cycles, seen: Motion, model: ImuModel, coefficients: Floats) -> CorrectedCycles:
    """Correct cycles for the sensor errors at given coefficients.

    Parameters
    ----------
    cycles : Cycles
        As measured.
    seen : Motion
        Near the true motion of the same cycles.
    coefficients : ndarray, shape (p,)
    """
    weight = slope_weight(seen, model, coefficients)
    return corrected(cycles, seen, weight, errors_along(model.sized(coefficients), seen))


def slope_weight(seen: Motion, model: ImuModel, coefficients: Floats) -> Floats:
    """``(I + S)^-1`` of every cycle, shape (n, 6, 6): change of true rate and force per change of the measured ones.

    Parameters
    ----------
    coefficients : ndarray, shape (p,)
        SI.
    """
    rows = slice(0, 1) if slope_is_constant(model, coefficients) else slice(None)
    inverse = np.linalg.inv(np.eye(6) + error_slope(model, seen, rows, coefficients))
    return np.ascontiguousarray(np.broadcast_to(inverse, (len(seen.t), 6, 6)))


def corrected(cycles: Cycles, seen: Motion, weight: Floats, errors: Floats) -> CorrectedCycles:
    """Correct cycles by one Newton step from a motion near the true one.

    Parameters
    ----------
    cycles : Cycles
        As measured, n of them.
    seen : Motion
        Near the true motion of the same cycles.
    weight : ndarray, shape (n, 6, 6)
        As `slope_weight` gives it.
    errors : ndarray, shape (n, 6)
        Sensor errors along `seen` (rad/s, m/s^2).
    """
    dt, near = cycles.dt[:, None], np.hstack([seen.w, seen.f])
    true, coning, sculling = np.empty_like(near), np.empty((len(near), 3)), np.empty((len(near), 3))
    _newton(cycles.dt, cycles.alpha, cycles.upsilon, near, weight, errors, true)
    _crossed(weight, 0, cycles.coning, coning)
    # Of two different vectors: right to the difference of the triads' errors times the correction itself.
    _crossed(weight, 3, cycles.sculling, sculling)
    taken_out = replace(cycles, alpha=true[:, :3] * dt, upsilon=true[:, 3:] * dt, coning=coning, sculling=sculling)
    return CorrectedCycles(taken_out, replace(seen, w=true[:, :3], f=true[:, 3:]), weight)


@compiled
def _newton(
    dt: Floats, alpha: Floats, upsilon: Floats, near: Floats, weight: Floats, errors: Floats, true: Floats
) -> None:
    """Fill true rate and force (n, 6) of cycles by one step from those `near` them (n, 6)."""
    defect = np.empty(6)
    for k in range(dt.shape[0]):
        for i in range(3):
            defect[i] = alpha[k, i] / dt[k] - near[k, i] - errors[k, i]
            defect[3 + i] = upsilon[k, i] / dt[k] - near[k, 3 + i] - errors[k, 3 + i]
        for i in range(6):
            true[k, i] = near[k, i]
            for j in range(6):
                true[k, i] += weight[k, i, j] * defect[j]


@compiled
def _crossed(weight: Floats, first: int, product: Floats, out: Floats) -> None:
    """Fill cross products (n, 3) of vectors that go through the block of `weight` from row and column `first` on.

    The products go through its cofactors.
    """
    for k in range(product.shape[0]):
        for i in range(3):
            a, b = first + (i + 1) % 3, first + (i + 2) % 3
            out[k, i] = 0.0
            for j in range(3):
                c, d = first + (j + 1) % 3, first + (j + 2) % 3
                cofactor = weight[k, a, c] * weight[k, b, d] - weight[k, a, d] * weight[k, b, c]
                out[k, i] += cofactor * product[k, j]


def spread(values: Floats, channel: Ints, parameter: Ints, weight: Floats) -> tuple[Floats, Ints, Ints]:
    """Regressors of corrected samples: ``weight @`` those of the measured ones, with the empty columns left out.

    Parameters
    ----------
    values : ndarray, shape (n, m)
        Regressors as measured (SI).
    channel, parameter : ndarray of int, shape (m,)
        Sensor axis and parameter of each column.
    weight : ndarray, shape (n, 6, 6)
        As in `CorrectedCycles`.

    Returns
    -------
    values : ndarray, shape (n, m')
    channel, parameter : ndarray of int, shape (m',)
    """
    columns, targets = np.nonzero(np.any(weight, axis=0).T[channel])
    spread_values = _weighed(np.ascontiguousarray(values), columns, channel[columns], targets, weight)
    return spread_values, targets.astype(np.int64), parameter[columns].astype(np.int64)


@compiled
def _weighed(values: Floats, columns: Ints, source: Ints, target: Ints, weight: Floats) -> Floats:
    """Columns of regressors (n, m), each times an element of the weights (n, 6, 6); shape (n, m')."""
    out = np.empty((values.shape[0], columns.shape[0]))
    for k in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[k, j] = weight[k, target[j], source[j]] * values[k, columns[j]]
    return out
