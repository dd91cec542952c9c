"""The whitened equations of the batch estimator (`batch`), stop by stop."""

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
"""Unknowns of a stop: attitude, velocity, position."""


@dataclass(frozen=True)
class LinearisationPoint:
    """Where the equations are linearised: coefficients (p,) and, for k stops, attitude, velocity and position."""

    coefficients: Floats
    C_nb: Floats
    velocity: Floats
    position: Floats


def rest_weights(setup: TestSetup, seconds: Floats) -> Floats:
    """One over sigma of the means of each block, shape (b, 6)."""
    rate = (setup.imu.gyro_white_noise**2 + setup.model.extra_rate_sigma**2) / seconds
    force = (setup.imu.accel_white_noise**2 + setup.model.extra_force_sigma**2) / seconds
    return 1.0 / np.sqrt(np.repeat(np.column_stack([rate, force]), 3, axis=1))


def rest_residual(setup: TestSetup, mean: Floats, slope: Floats, C_nb: Floats) -> tuple[Floats, Floats]:
    """Measured minus predicted means (b, 6) of a perfect IMU, and their change per small turn in n (b, 6, 3).

    With C turned by a: C_bn v becomes C_bn (v - a x v); `slope` (b, 6, 6) of the errors goes with it.
    """
    w_ie, g_n = earth.earth_rate(setup.site.latitude_rad), np.array([0.0, 0.0, setup.gravity])
    residual = mean - np.concatenate([C_nb.T @ w_ie, -C_nb.T @ g_n])
    change = -np.vstack([C_nb.T @ skew(w_ie), -C_nb.T @ skew(g_n)])
    return residual, change + slope @ change


def still(setup: TestSetup, velocity: Floats, position: Floats, p: int) -> tuple[Floats, Floats, Floats]:
    """Say that a stop stands still at the known point."""
    sigma = np.repeat([setup.model.velocity_sigma, setup.model.position_sigma], 3)
    own = np.zeros((6, PER_STOP))
    own[:, 3:] = np.diag(1.0 / sigma)
    return own, np.zeros((6, p)), np.concatenate([velocity, position]) / sigma


def initial(start: Alignment, C_nb: Floats, p: int) -> tuple[Floats, Floats, Floats]:
    """Say that the first attitude is the alignment's within its sigma."""
    own = np.zeros((3, PER_STOP))
    own[:, :3] = np.diag(1.0 / start.filter_sigma)
    return own, np.zeros((3, p)), rotation_vector(C_nb @ start.C_nb.T) / start.filter_sigma


def step_rows(
    gone: Preintegration, point: LinearisationPoint, k: int, resting: float, prior: Floats
) -> tuple[tuple[Floats, Floats, Floats, Floats], float]:
    """Whitened rows from stop k to the next, and the log of their weight."""
    L = np.linalg.cholesky(gone.noise)
    seconds = resting + gone.seconds
    own = np.zeros((9, PER_STOP))
    own[:, :3] = -gone.by_attitude
    own[3:6, 3:6] = own[6:9, 6:9] = -np.eye(3)
    own[6:9, 3:6] = -seconds * np.eye(3)
    residual = np.concatenate([
        rotation_vector(point.C_nb[k + 1] @ gone.C_nb.T),
        point.velocity[k + 1] - point.velocity[k] - gone.moved[:3],
        point.position[k + 1] - point.position[k] - seconds * point.velocity[k] - gone.moved[3:],
    ])  # fmt: skip
    white = np.linalg.solve(L, np.hstack([own, np.eye(9), -gone.by_coefficient * prior, residual[:, None]]))
    rows = (white[:, :9], white[:, 9:18], white[:, 18:-1], white[:, -1])
    return rows, -float(np.sum(np.log(np.diag(L))))


def nothing(p: int) -> tuple[Floats, Floats, Floats, Floats]:
    """Make the rows from the last stop to none."""
    return np.zeros((0, PER_STOP)), np.zeros((0, PER_STOP)), np.zeros((0, p)), np.zeros(0)
