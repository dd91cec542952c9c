"""The force of an epoch on a table that vibrates at rest: that of the attitude at the end of the epoch."""

from __future__ import annotations

from sdimu_calibration.core import earth
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.compiled import compiled


@compiled
def at_the_end(latitude: float, f_n: Floats, dts: Floats, C_mean: Floats, C_nb: Floats, sums: Floats) -> None:
    """Bring the velocity increment of an epoch from its mean attitude to the one at its end, in place.

    The mean attitude of a cycle is that against the axes at its begin: half of its Earth rate is in it.

    Parameters
    ----------
    latitude : float
        Of the site (rad).
    f_n : ndarray, shape (3,)
        Specific force at rest in NED (m/s^2).
    dts : ndarray, shape (n,)
        Lengths of the cycles (s).
    C_mean : ndarray, shape (n or more, 3, 3)
        Mean attitude of each cycle, b to n (dimensionless).
    C_nb : ndarray, shape (3, 3)
        Attitude at the end of the epoch, b to n (dimensionless).
    sums : ndarray, shape (6,)
        Angle (rad) and velocity increment (m/s) in b; the latter changes.
    """
    north = earth.earth_rate(latitude)[0]
    for k in range(dts.shape[0]):
        for i in range(3):
            mean = C_mean[k, 2, i] - 0.5 * dts[k] * north * C_mean[k, 1, i]
            sums[3 + i] -= dts[k] * f_n[2] * (mean - C_nb[2, i])
