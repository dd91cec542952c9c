"""The Earth: WGS-84 ellipsoid, rotation, normal gravity, in local-level NED.

Source: NIMA TR8350.2, 3rd ed. (WGS-84); formulas as in Groves, *Principles of GNSS, Inertial, and
Multisensor Integrated Navigation Systems*, 2nd ed., ch. 2.
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.compiled import compiled

RATE = 7.292115e-5
"""Earth rate against inertial space (rad/s): WGS-84."""
SEMI_MAJOR = 6378137.0
"""Equatorial radius (m): WGS-84."""
FLATTENING = 1.0 / 298.257223563
"""Flattening of the ellipsoid (1): WGS-84."""
ECCENTRICITY_SQUARED = FLATTENING * (2.0 - FLATTENING)
"""First eccentricity squared (1): follows from the flattening."""
GRAVITATION = 3.986004418e14
"""GM of the Earth with its atmosphere (m^3/s^2): WGS-84."""
GRAVITY_EQUATOR = 9.7803253359
"""Normal gravity on the ellipsoid at the equator (m/s^2): WGS-84."""
SOMIGLIANA_K = 0.00193185265241
"""Coefficient of the squared sine of the latitude in Somigliana's formula (1): WGS-84."""
POLE_LIMIT = np.radians(89.9)
"""Largest latitude in the transport rate (rad): NED is singular at the pole."""


@compiled
def earth_rate(latitude: float) -> Floats:
    """Earth rate in NED (rad/s), shape (3,).

    Parameters
    ----------
    latitude : float
        Geodetic (rad).
    """
    w = np.zeros(3)
    w[0] = RATE * np.cos(latitude)
    w[2] = -RATE * np.sin(latitude)
    return w


@compiled
def radii(latitude: float) -> tuple[float, float]:
    """Meridian and prime-vertical radii of curvature (m) at a geodetic latitude (rad)."""
    d = 1.0 - ECCENTRICITY_SQUARED * np.sin(latitude) ** 2
    return SEMI_MAJOR * (1.0 - ECCENTRICITY_SQUARED) / d**1.5, SEMI_MAJOR / np.sqrt(d)


@compiled
def normal_gravity(latitude: float, height: float) -> float:
    """Magnitude of normal gravity (m/s^2): Somigliana on the ellipsoid, second order in height.

    Parameters
    ----------
    latitude : float
        Geodetic (rad).
    height : float
        Above the ellipsoid (m); the series holds to 1e-8 of g below 10 km.

    Returns
    -------
    float
        Includes the centrifugal part (plumb-bob gravity). Its small north component above the
        ellipsoid (8e-9 m/s^2 per metre) is left out.
    """
    s2 = np.sin(latitude) ** 2
    g0 = GRAVITY_EQUATOR * (1.0 + SOMIGLIANA_K * s2) / np.sqrt(1.0 - ECCENTRICITY_SQUARED * s2)
    m = RATE**2 * SEMI_MAJOR**3 * (1.0 - FLATTENING) / GRAVITATION
    linear = 1.0 + FLATTENING + m - 2.0 * FLATTENING * s2
    gravity: float = g0 * (1.0 - 2.0 / SEMI_MAJOR * linear * height + 3.0 * height**2 / SEMI_MAJOR**2)
    return gravity
