"""Whitened equations of the batch estimator (`batch`), stop by stop.

Unknowns of a stop: small rotation (rad), velocity (m/s) and displacement (m), all in n (North, East, Down).
Coefficients are in SI units; `prior` scales their columns to units of the prior's sigma. Rows are those of
`chain.Link`: unknowns, then the negative of the residual.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.alignment.alignment import Alignment
from sdimu_calibration.core.alignment.prepared import TestSetup
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.batch.preintegration import Preintegration
from sdimu_calibration.core.rotation import rotation_vector, skew

PER_STOP = 9
"""Number of unknowns of a stop: attitude, velocity, position."""


@dataclass(frozen=True)
class LinearisationPoint:
    """Point about which the equations of k stops are linearised."""

    coefficients: Floats
    """Shape (p,)."""
    C_nb: Floats
    """Shape (k, 3, 3)."""
    velocity: Floats
    position: Floats
    """`velocity`, `position`: velocity (m/s), and displacement from the known point (m), shape (k, 3)."""


def rest_weights(setup: TestSetup, seconds: Floats) -> Floats:
    """One over the sigma of the means of each block.

    Parameters
    ----------
    seconds : ndarray, shape (b,)
        Length of each block (s).

    Returns
    -------
    ndarray, shape (b, 6)
        Of rate (s/rad) and specific force (s^2/m).
    """
    rate = (setup.imu.gyro_white_noise**2 + setup.model.extra_rate_sigma**2) / seconds
    force = (setup.imu.accel_white_noise**2 + setup.model.extra_force_sigma**2) / seconds
    return 1.0 / np.sqrt(np.repeat(np.column_stack([rate, force]), 3, axis=1))


def rest_residual(setup: TestSetup, mean: Floats, slope: Floats, C_nb: Floats) -> tuple[Floats, Floats]:
    """Measured means minus those of a perfect IMU, and the change of the difference per small rotation.

    With C_nb turned by a small a in n, ``C_bn v`` becomes ``C_bn (v - a x v)``, and the errors follow with their slope.

    Parameters
    ----------
    mean : ndarray, shape (b, 6)
        Rate (rad/s) and specific force (m/s^2).
    slope : ndarray, shape (b, 6, 6)
        `error_slope` of the blocks.
    C_nb : ndarray, shape (3, 3)

    Returns
    -------
    residual : ndarray, shape (b, 6)
    change : ndarray, shape (b, 6, 3)
    """
    w_ie, g_n = earth.earth_rate(setup.site.latitude_rad), np.array([0.0, 0.0, setup.gravity])
    residual = mean - np.concatenate([C_nb.T @ w_ie, -C_nb.T @ g_n])
    change = -np.vstack([C_nb.T @ skew(w_ie), -C_nb.T @ skew(g_n)])
    return residual, change + slope @ change


def still(setup: TestSetup, velocity: Floats, position: Floats, p: int) -> Floats:
    """Rows that hold a stop at rest at the known point.

    Parameters
    ----------
    velocity, position : ndarray, shape (3,)
        Of the stop (m/s, m).
    p : int
        Number of coefficients.

    Returns
    -------
    ndarray, shape (6, 9 + p + 1)
    """
    sigma = np.repeat([setup.model.velocity_sigma, setup.model.position_sigma], 3)
    rows = np.zeros((6, PER_STOP + p + 1))
    rows[:, 3:PER_STOP] = np.diag(1.0 / sigma)
    rows[:, -1] = -np.concatenate([velocity, position]) / sigma
    return rows


def initial(start: Alignment, C_nb: Floats, p: int) -> Floats:
    """Rows that hold the first attitude at that of the alignment within its sigma.

    Parameters
    ----------
    C_nb : ndarray, shape (3, 3)
        Attitude at the first stop.
    p : int
        Number of coefficients.

    Returns
    -------
    ndarray, shape (3, 9 + p + 1)
    """
    rows = np.zeros((3, PER_STOP + p + 1))
    rows[:, :3] = np.diag(1.0 / start.filter_sigma)
    rows[:, -1] = -rotation_vector(C_nb @ start.C_nb.T) / start.filter_sigma
    return rows


def step_rows(
    gone: Preintegration, point: LinearisationPoint, k: int, resting: float, prior: Floats
) -> tuple[Floats, float]:
    """Rows that couple stop k to the next by what the IMU integrated in between.

    Parameters
    ----------
    resting : float
        Length of stop k (s); its unknowns are those at its start.
    prior : ndarray, shape (p,)
        Sigma of each coefficient.

    Returns
    -------
    rows : ndarray, shape (9, 18 + p + 1)
    log_weight : float
        Logarithm of the determinant of the whitening.
    """
    L = np.linalg.cholesky(gone.noise)
    seconds = resting + gone.seconds
    own = np.zeros((9, PER_STOP))
    own[:, :3] = -gone.by_attitude
    own[3:6, 3:6] = own[6:9, 6:9] = -np.eye(3)
    own[6:9, 3:6] = -seconds * np.eye(3)
    residual = np.concatenate(
        [
            rotation_vector(point.C_nb[k + 1] @ gone.C_nb.T),
            point.velocity[k + 1] - point.velocity[k] - gone.moved[:3],
            point.position[k + 1] - point.position[k] - seconds * point.velocity[k] - gone.moved[3:],
        ]
    )
    rows = np.hstack([own, np.eye(9), -gone.by_coefficient * prior, -residual[:, None]])
    return np.linalg.solve(L, rows), -float(np.sum(np.log(np.diag(L))))
