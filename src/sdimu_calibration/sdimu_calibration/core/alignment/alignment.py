"""Coarse alignment: level from specific force, azimuth from Earth rate, for any orientation of the axes.

The filter linearises about this attitude. It starts with wider sigmas than the alignment has and takes the same samples
as its first measurements, so that attitude and biases get their correlation from one source.

SI units; frames n (North, East, Down) and b (body); `C_nb` maps b to n.

Source: Groves, *Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems*, 2nd ed., section 5.6
(TRIAD on gravity and Earth rate).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.bias import ACCEL_BIAS, GYRO_BIAS
from sdimu_calibration.core.effects.mass_unbalance import GYRO_MASS_UNBALANCE
from sdimu_calibration.core.effects.misalignment import ACCEL_MISALIGNMENT
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.rotation import rotation_matrix
from sdimu_calibration.core.specification import ImuSpecification, Site

UNKNOWN_AZIMUTH = np.pi / np.sqrt(3.0)
"""Sigma of an unknown azimuth (rad): that of a uniform distribution over the circle."""
_CONVENTION_RAD = 1e-5
"""Sigma of an azimuth that is a convention (rad): no data move it, and the covariance stays regular."""
_WIDEN = 10.0
"""Factor from the sigmas of the alignment to those of the filter: the filter takes the same samples again."""


@dataclass(frozen=True)
class Alignment:
    """Initial attitude."""

    C_nb: Floats
    """Shape (3, 3)."""
    sigma: Floats
    """Sigma of the attitude error about N, E, D (rad), shape (3,)."""
    filter_sigma: Floats
    """Sigma with which the filter starts (rad), shape (3,)."""

    def with_azimuth_of(self, C_nb: Floats) -> Alignment:
        """Return the alignment with the azimuth of an attitude as a convention, which no data move.

        Parameters
        ----------
        C_nb : ndarray, shape (3, 3)
            Attitude at the start, b to n (dimensionless).
        """
        sigma = np.array([*self.filter_sigma[:2], _CONVENTION_RAD])
        return replace(self, C_nb=C_nb.copy(), filter_sigma=sigma)


def azimuth_of(C_nb: Floats) -> float:
    """Azimuth of body X, or of body Y where X is within 45 deg of the vertical.

    Parameters
    ----------
    C_nb : ndarray, shape (3, 3)

    Returns
    -------
    float
        rad, clockwise from north.
    """
    axis = C_nb[:, 0] if abs(C_nb[2, 0]) < np.sqrt(0.5) else C_nb[:, 1]
    return float(np.arctan2(axis[1], axis[0]))


def levelled(C_nb: Floats, f_ib_b: Floats) -> Floats:
    """Turn an attitude by the smallest angle that makes the specific force at rest point up.

    Parameters
    ----------
    C_nb : ndarray, shape (3, 3)
    f_ib_b : ndarray, shape (3,)
        Specific force at rest (m/s^2).

    Returns
    -------
    ndarray, shape (3, 3)
    """
    f_n = C_nb @ f_ib_b
    axis = np.array([-f_n[1], f_n[0], 0.0])
    sine = float(np.hypot(f_n[0], f_n[1]))
    angle = float(np.arctan2(sine, -f_n[2]))
    return np.asarray(rotation_matrix(axis * (angle / max(sine, 1e-12))) @ C_nb)


def align(w_mean: Floats, f_mean: Floats, duration_s: float, site: Site, imu: ImuSpecification) -> Alignment:
    """Level and find north.

    Parameters
    ----------
    w_mean, f_mean : ndarray, shape (3,)
        Mean body rate (rad/s) and specific force (m/s^2) at rest, in b.
    duration_s : float
        Time over which they are means.
    site : Site
        An azimuth given there replaces gyrocompassing.
    imu : ImuSpecification
        Its priors give the sigmas.
    """
    norm = float(np.linalg.norm(f_mean))
    if not norm > 1.0:
        raise DataError("/imu/data_raw: no specific force at rest; is linear_acceleration in m/s^2 with gravity in it?")
    down = -f_mean / norm
    east = np.cross(down, w_mean)
    horizontal = float(np.linalg.norm(east))
    if horizontal < 1e-12:
        east = np.cross(down, np.eye(3)[int(np.argmin(np.abs(down)))])
    east = east / np.linalg.norm(east)
    C_nb = np.vstack([np.cross(east, down), east, down])

    prior = imu.prior
    accel = np.hypot(prior.get(ACCEL_BIAS.name, 0.0), imu.accel_white_noise / np.sqrt(duration_s))
    level = float(np.hypot(accel / norm, prior.get(ACCEL_MISALIGNMENT.name, 0.0)))
    gyro = np.sqrt(
        prior.get(GYRO_BIAS.name, 0.0) ** 2
        + prior.get(GYRO_MASS_UNBALANCE.name, 0.0) ** 2
        + imu.gyro_white_noise**2 / duration_s
    )
    rate = max(earth.RATE * np.cos(site.latitude_rad), 1e-12)
    azimuth = min(float(np.hypot(gyro / rate, level)), UNKNOWN_AZIMUTH)
    start = min(_WIDEN * azimuth, UNKNOWN_AZIMUTH)
    if site.initial_azimuth_rad is not None:
        turn = site.initial_azimuth_rad - azimuth_of(C_nb)
        C_nb = rotation_matrix(np.array([0.0, 0.0, turn])) @ C_nb
        azimuth = start = site.initial_azimuth_sigma_rad
    wide = min(_WIDEN * level, 0.5)
    return Alignment(C_nb, np.array([level, level, azimuth]), np.array([wide, wide, start]))
