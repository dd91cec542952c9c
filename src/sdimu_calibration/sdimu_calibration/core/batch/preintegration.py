"""Preintegration: what the IMU integrates over a motion from rest to rest, and its linear response.

SI units; frame n is North, East, Down.

The idea is that of Forster, Carlone, Dellaert & Scaramuzza, "On-Manifold Preintegration for Real-Time Visual-Inertial
Odometry", IEEE Trans. Robotics 33 (2017); here with Earth rate, Coriolis force and the gradient of gravity.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.alignment.prepared import PreparedData, TestSetup
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.data.gaps import GAP_SHARE
from sdimu_calibration.core.effects.error_slope import error_slope
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.navigation.strapdown import Cycles, navigate
from sdimu_calibration.core.rotation import rotation_matrix, skew


@dataclass(frozen=True)
class Preintegration:
    """Integral of one motion from rest to rest that starts at a given attitude with velocity zero."""

    C_nb: Floats
    """Attitude at the end, shape (3, 3)."""
    moved: Floats
    """Velocity (m/s) and change of position (m), N, E, D, shape (6,)."""
    seconds: float
    """Length of the motion."""
    by_attitude: Floats
    """Change of attitude (rad), velocity (m/s) and position (m) at the end per small rotation in n at the start (rad),
    shape (9, 3)."""
    by_coefficient: Floats
    """Change per unit of each coefficient for which the samples are corrected, shape (9, p)."""
    noise: Floats
    """Covariance of attitude, velocity and position from white sensor noise, shape (9, 9)."""


def _navigated(
    cycles: Cycles, setup: TestSetup, values: Floats, coefficients: Floats, C_nb: Floats
) -> tuple[Floats, Floats, Floats]:
    """Integrate corrected samples: what `navigate` gives, and the velocity increments (n, 3) without their errors.

    `values`: regressors of the cycles, shape (n, m); the rest as for `preintegrate`.
    """
    error = setup.sensors.errors(values, coefficients) * cycles.dt[:, None]
    clean = replace(cycles, alpha=cycles.alpha - error[:, :3], upsilon=cycles.upsilon - error[:, 3:])
    return *navigate(clean, C_nb, setup.site.latitude_rad, setup.site.height_m, setup.gravity), clean.upsilon


def arrival(
    prepared: PreparedData, rows: slice, setup: TestSetup, values: Floats, coefficients: Floats, C_nb: Floats
) -> Floats:
    """Attitude at the end of one motion, b to n, shape (3, 3): that of `preintegrate`, without linear responses.

    Parameters
    ----------
    rows : slice
        Cycles of the motion.
    values : ndarray, shape (n, m)
        Regressors of all cycles.
    coefficients : ndarray, shape (p,)
        Coefficients for which the samples are corrected.
    C_nb : ndarray, shape (3, 3)
        Attitude at the start.
    """
    track, _, _ = _navigated(prepared.cycles[rows], setup, values[rows], coefficients, C_nb)
    return np.asarray(track[-1])


def preintegrate(
    prepared: PreparedData,
    rows: slice,
    setup: TestSetup,
    seen: Motion,
    values: Floats,
    coefficients: Floats,
    C_nb: Floats,
) -> Preintegration:
    """Integrate one motion and linearise it.

    The linear responses are taken in the frame that does not turn and coincides with n at the end of the motion. There,
    attitude errors are constant and velocity errors grow by their product with the force and by the gradient of
    gravity.

    Parameters
    ----------
    rows : slice
        Cycles of the motion.
    setup : TestSetup
        Site, gravity, white noise and the model of the sensors.
    seen : Motion
        Of all cycles.
    values : ndarray, shape (n, m)
        Regressors of all cycles.
    coefficients : ndarray, shape (p,)
        Coefficients for which the samples are corrected.
    C_nb : ndarray, shape (3, 3)
        Attitude at the start.
    """
    model, latitude, height = setup.sensors, setup.site.latitude_rad, setup.site.height_m
    densities = setup.imu.gyro_white_noise**2, setup.imu.accel_white_noise**2
    c = prepared.cycles[rows]
    own = values[rows]
    track, moved, upsilon = _navigated(c, setup, own, coefficients, C_nb)
    left = np.cumsum(c.dt[::-1])[::-1] - 0.5 * c.dt
    still = _not_turning(0.5 * (track[:-1] + track[1:]), left, latitude)
    dv = np.einsum("kij,kj->ki", still, upsilon)
    # What is still to come after each cycle: velocity, and the displacement that it makes.
    velocity = np.cumsum(dv[::-1], axis=0)[::-1] - 0.5 * dv
    # An increment displaces by the time after itself, not by the time since the cycle: they differ as n turns.
    part = dv * left[:, None]
    position = np.cumsum(part[::-1], axis=0)[::-1] - 0.5 * part
    by_angle, by_push = _transfers(velocity, position, left)
    turn = rotation_matrix(-float(c.dt.sum()) * earth.earth_rate(latitude))
    whole = np.vstack([np.eye(3), -skew(dv.sum(axis=0)), -skew(part.sum(axis=0))])
    _pulled(by_angle, by_push, whole, dv, left, latitude, height)
    for response in (by_angle, by_push, whole):
        _over_the_earth(response, latitude, height)
    # A sample is (1 + slope) times the truth and more, so what is taken out of it weighs 1 / (1 + slope).
    slope, in_n = error_slope(model, seen, rows, coefficients), np.zeros((len(own), 6, 6))
    in_n[:, :3, :3] = in_n[:, 3:, 3:] = still
    weight = np.concatenate([by_angle, by_push], axis=2) @ in_n @ np.linalg.inv(np.eye(6) + slope)
    coefficient = np.zeros((9, len(model.prior)))
    for column, (channel, parameter) in enumerate(zip(model.channel, model.parameter, strict=True)):
        coefficient[:, parameter] -= (own[:, column] * c.dt) @ weight[:, :, channel]
    noise = densities[0] * np.einsum("kij,klj,k->il", by_angle, by_angle, c.dt)
    noise += densities[1] * np.einsum("kij,klj,k->il", by_push, by_push, c.dt)
    noise[range(3), range(3)] += np.sum((GAP_SHARE * c.gap_angle) ** 2)
    seconds = float(c.dt.sum())
    return Preintegration(track[-1], moved[-1], seconds, whole @ turn, coefficient, noise)


def _pulled(
    by_angle: Floats, by_push: Floats, whole: Floats, dv: Floats, left: Floats, latitude: float, height: float
) -> None:
    """Add to the responses, in place, that gravity changes with the displacement: to first order in its gradient.

    A push displaces by the time after it, so gravity adds its gradient times left^2 / 2 to the velocity and left^3 / 6
    to the position; what a small turn makes of later increments `dv` (n, 3) goes the same way.
    """
    r_n, r_e = earth.radii(latitude)
    stiffness = earth.normal_gravity(latitude, height) / (np.sqrt(r_n * r_e) + height)
    gradient = np.diag([-stiffness, -stiffness, 2.0 * stiffness])
    for row, power in ((3, left**2 / 2.0), (6, left**3 / 6.0)):
        part = dv * power[:, None]
        after = np.cumsum(part[::-1], axis=0)[::-1] - 0.5 * part
        by_push[:, row : row + 3] += power[:, None, None] * gradient
        by_angle[:, row : row + 3] -= gradient @ _crosses(after)
        whole[row : row + 3] -= gradient @ skew(part.sum(axis=0))


def _crosses(v: Floats) -> Floats:
    """Cross product matrices of vectors (n, 3), shape (n, 3, 3)."""
    out = np.zeros((len(v), 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out[:, i, j], out[:, i, k] = -v[:, k], v[:, j]
    return out


def _over_the_earth(response: Floats, latitude: float, height: float) -> None:
    """Take responses (..., 9, 3) at the end of a motion from the frame that does not turn to n, in place.

    Velocity over the Earth is less by what the Earth carries along; and n is that of the place navigated to, so that a
    displacement tilts it.
    """
    at = min(max(latitude, -earth.POLE_LIMIT), earth.POLE_LIMIT)
    r_n, r_e = earth.radii(at)
    tilt = np.zeros((3, 3))
    tilt[0, 1], tilt[1, 0], tilt[2, 1] = 1.0 / (r_e + height), -1.0 / (r_n + height), -np.tan(at) / (r_e + height)
    response[..., 3:6, :] -= skew(earth.earth_rate(latitude)) @ response[..., 6:9, :]
    response[..., 0:3, :] -= tilt @ response[..., 6:9, :]


def _not_turning(C_nb: Floats, left: Floats, latitude: float) -> Floats:
    """Attitudes (n, 3, 3) in the frame that does not turn and meets n after `left` (n,) seconds.

    To first order in Earth rate times time, which is 1e-2 for minutes.
    """
    w = earth.earth_rate(latitude)
    return np.asarray(C_nb - left[:, None, None] * (skew(w) @ C_nb))


def _transfers(velocity: Floats, position: Floats, left: Floats) -> tuple[Floats, Floats]:
    """Attitude, velocity and position at the end per small turn and per push in each cycle, (n, 9, 3) each.

    `velocity`, `position` (n, 3): what the force makes after the cycle; `left` (n,): time after it.
    """
    n = len(left)
    by_angle, by_push = np.zeros((n, 9, 3)), np.zeros((n, 9, 3))
    by_angle[:, 0:3], by_push[:, 3:6] = np.eye(3), np.eye(3)
    by_push[:, 6:9] = left[:, None, None] * np.eye(3)
    # psi x s = -[s x] psi
    by_angle[:, 3:6] -= _crosses(velocity)
    by_angle[:, 6:9] -= _crosses(position)
    return by_angle, by_push
