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
    rows = slice(0, 1) if slope_is_constant(model, coefficients) else slice(None)
    inverse = np.linalg.inv(np.eye(6) + error_slope(model, seen, rows, coefficients))
    weight = np.ascontiguousarray(np.broadcast_to(inverse, (len(cycles), 6, 6)))
    dt = cycles.dt[:, None]
    near = np.hstack([seen.w, seen.f])
    defect = np.hstack([cycles.alpha, cycles.upsilon]) / dt - near - errors_along(model.sized(coefficients), seen)
    true = near + np.einsum("kij,kj->ki", weight, defect)
    corrected = replace(
        cycles,
        alpha=true[:, :3] * dt,
        upsilon=true[:, 3:] * dt,
        coning=_crossed(weight[:, :3, :3], cycles.coning),
        # Of two different vectors: right to the difference of the triads' errors times the correction itself.
        sculling=_crossed(weight[:, 3:, 3:], cycles.sculling),
    )
    return CorrectedCycles(corrected, replace(seen, w=true[:, :3], f=true[:, 3:]), weight)


def _crossed(U: Floats, product: Floats) -> Floats:
    """Cross products of vectors that go through `U` (n, 3, 3): the products (n, 3) go through its cofactors."""
    rows = U.transpose(1, 0, 2)
    cofactor = [np.cross(rows[(k + 1) % 3], rows[(k + 2) % 3]) for k in range(3)]
    return np.column_stack([np.einsum("kj,kj->k", row, product) for row in cofactor])


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
