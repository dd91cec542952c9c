"""Coarse alignment from the whole test: attitude and biases where the first dwell alone gives a wrong azimuth.

Gyrocompassing in one dwell fails when the gyro bias exceeds Earth rate, and an azimuth from a site file may be wrong by
any angle. All stops together determine both. At rest the mean rate is bias plus Earth rate; subtracted from the samples
of a turn it leaves the turn itself, good to the scale factors, hence the orientation of every stop in the body frame of
the first one. In these orientations gravity and Earth rate are two constant vectors, the biases two others, and linear
least squares separates them without a starting value.

The idea is that of multi-position alignment (Groves, *Principles of GNSS, Inertial, and Multisensor Integrated
Navigation Systems*, 2nd ed., section 5.6.3), made linear. SI units; frames n (North, East, Down) and b (body).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.alignment.alignment import Alignment
from sdimu_calibration.core.alignment.prepared import PreparedData, TestSetup
from sdimu_calibration.core.alignment.rest_means import layout, rest_means
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.effects.bias import ACCEL_BIAS, GYRO_BIAS
from sdimu_calibration.core.effects.mass_unbalance import GYRO_MASS_UNBALANCE
from sdimu_calibration.core.rotation import orthonormal, rotation_matrix

_FREE = 1e3
"""Sigma of an unknown vector, a multiple of its size: wide enough to be no prior."""
_MODEL_ERROR = 0.01
"""Sigma of the misfit, a share of the vector sought: scale, misalignment and orientation errors are left out."""
_STOPS = 20
"""Number of stops used, from the first on: the error of the orientations grows with every turn."""


@dataclass(frozen=True)
class StartPoint:
    """Where passes or least squares linearise first."""

    C_nb: Floats
    """Initial attitude, b to n, shape (3, 3)."""
    coefficients: Floats
    """Shape (p,). SI; after a coarse alignment the biases where the model has them, else zero."""


@compiled
def _turn(alpha: Floats, coning: Floats, dt: Floats, offset: Floats) -> Floats:
    """Rotation (3, 3) over cycles whose rate is too large by `offset`."""
    C = np.eye(3)
    for k in range(dt.shape[0]):
        C = orthonormal(C @ rotation_matrix(alpha[k] + coning[k] - offset * dt[k]))
    return C


def coarse_start(prepared: PreparedData, setup: TestSetup, start: Alignment) -> StartPoint:
    """Find attitude and biases from all stops.

    Parameters
    ----------
    start : Alignment
        Returned unchanged for a test of fewer than three stops.
    """
    names, prior = setup.sensors.names, setup.sensors.prior
    coefficients = np.zeros(len(prior))
    where = layout(prepared)
    if len(where.stop_first) < 3:
        return StartPoint(start.C_nb, coefficients)
    none = np.zeros((len(prepared.cycles), len(setup.sensors.channel)))
    rest = rest_means(prepared, where, setup.sensors, none)
    time = np.bincount(where.block_stop, rest.seconds)
    mean = np.column_stack([np.bincount(where.block_stop, rest.seconds * v) / time for v in rest.mean.T])
    time, mean = time[:_STOPS], mean[:_STOPS]
    to_first = _orientations(prepared, where.stop_last, where.stop_first, mean[:, :3])
    sizes = dict(zip(names, prior, strict=True))
    noise = np.array([setup.imu.gyro_white_noise, setup.imu.accel_white_noise]) / np.sqrt(np.mean(time))
    accel_bias = sizes.get(ACCEL_BIAS.labels[0], 0.0)
    down, bias_f = _constant(to_first, -mean[:, 3:], setup.gravity, accel_bias, np.zeros((len(time), 0)), 0.0, noise[1])
    g_sensitivity = sizes.get(GYRO_MASS_UNBALANCE.labels[0], 0.0)
    a = -np.einsum("kji,j->ki", to_first, down) / setup.gravity
    gyro_bias = sizes.get(GYRO_BIAS.labels[0], 0.0)
    rate, bias_w = _constant(to_first, mean[:, :3], earth.RATE, gyro_bias, a, g_sensitivity, noise[0])
    for effect, bias in ((GYRO_BIAS, bias_w), (ACCEL_BIAS, -bias_f)):
        for name, value in zip(effect.labels, bias, strict=True):
            if name in names:
                coefficients[names.index(name)] = value
    return StartPoint(_level_and_north(down, rate), coefficients)


def _orientations(prepared: PreparedData, last: Ints, first: Ints, rate: Floats) -> Floats:
    """Orientation of every stop in the body frame of the first, shape (k, 3, 3).

    The mean of `rate` (k, 3) at rest before and after a turn is subtracted from the rate in the turn.
    """
    out = [np.eye(3)]
    for k in range(len(rate) - 1):
        c = prepared.cycles[slice(int(last[k]), int(first[k + 1]))]
        out.append(out[-1] @ _turn(c.alpha, c.coning, c.dt, 0.5 * (rate[k] + rate[k + 1])))
    return np.array(out)


def _level_and_north(down: Floats, rate: Floats) -> Floats:
    """Attitude from gravity and Earth rate, both in b (TRIAD, gravity first); any azimuth without Earth rate."""
    d = down / np.linalg.norm(down)
    east = np.cross(d, rate)
    if float(np.linalg.norm(east)) < 1e-12:
        east = np.cross(d, np.eye(3)[int(np.argmin(np.abs(d)))])
    east = east / np.linalg.norm(east)
    return np.vstack([np.cross(east, d), east, d])


def _constant(
    to_first: Floats, mean: Floats, size: float, bias: float, more: Floats, sigma: float, noise: float
) -> tuple[Floats, Floats]:
    """Vector that is constant in the first body frame, and one that is constant in the body.

    Parameters
    ----------
    to_first : ndarray, shape (k, 3, 3)
    mean : ndarray, shape (k, 3)
        Sum of both vectors at each stop, in the body frame.
    size : float
        Of the first vector, for scale.
    bias : float
        Sigma of the second.
    more : ndarray, shape (k, m)
        Further variables to which each body axis may respond, with coefficients of sigma `sigma`.
    noise : float
        Sigma of the means.

    Returns
    -------
    constant, bias : ndarray, shape (3,)
    """
    k, m = more.shape
    rows = np.zeros((3 * k, 6 + 3 * m))
    rows[:, :3] = np.transpose(to_first, (0, 2, 1)).reshape(-1, 3) * size
    rows[:, 3:6] = np.tile(np.eye(3) * bias, (k, 1))
    for axis in range(3):
        rows[axis::3, 6 + axis * m : 6 + (axis + 1) * m] = more * sigma
    # Unknowns in units of their size; a weak prior at zero fixes what the stops do not determine.
    noise = float(np.hypot(noise, _MODEL_ERROR * size))
    pull = np.eye(rows.shape[1])
    pull[range(3), range(3)] = 1.0 / _FREE
    solution = np.linalg.lstsq(
        np.vstack([rows / noise, pull]), np.concatenate([mean.ravel() / noise, np.zeros(len(pull))]), rcond=None
    )[0]
    return solution[:3] * size, solution[3:6] * bias
