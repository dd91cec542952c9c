"""Is the azimuth known well enough for a linear filter? A few stops, or one long one, leave it open.

A wrong azimuth a turns the horizontal Earth rate, O = 7.29e-5 rad/s times the cosine of latitude. The filter counts
the first order, O a, across; along, the second order O a^2 / 2 is missing in it and goes into the gyro biases, whatever
their sigma says. Where Earth rate has been seen from many attitudes the azimuth is known to an arcminute and this is
nothing; after one or two stops it is known only as well as a gyro bias, and the estimate is bent.
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.filter.filter_pass import NAV
from sdimu_calibration.core.filter.passes import Solution

_SIGMAS = 3.0
_LEAST_ATTITUDES = 3
_SAME = np.cos(np.radians(10.0))
"""Cosine of the rotation up to which two attitudes are one."""


def azimuth_warning(solution: Solution) -> str | None:
    """Say so when there are too few attitudes, or the second order of the azimuth exceeds the sigma of a gyro bias.

    The second order is taken at three sigma, against the smallest sigma of a bias. With one or two attitudes the
    sigmas themselves are bent, and only the attitudes are counted.
    """
    attitudes = _attitudes(solution)
    if attitudes < _LEAST_ATTITUDES:
        return (
            f"the IMU was at rest in {attitudes} attitude{'s' if attitudes > 1 else ''} only: azimuth and gyro biases "
            "cannot be told apart, and their sigmas are not to be trusted; use a plan with more attitudes"
        )
    P, names = solution.last.state.P, solution.setup.sensors.names
    sigma = np.sqrt(np.diag(P))
    biases = [sigma[NAV + i] for i, name in enumerate(names) if name.startswith("gyro_bias")]
    if not biases:
        return None
    azimuth = float(sigma[-1])
    bent = 0.5 * (_SIGMAS * azimuth) ** 2 * earth.RATE * float(np.cos(solution.setup.site.latitude_rad))
    if bent <= min(biases):
        return None
    return (
        f"the azimuth is known only to {np.degrees(azimuth):.2g} deg: gyro biases may be wrong by "
        f"{np.degrees(bent) * 3600.0:.2g} deg/h beyond their sigma; use a plan with more attitudes"
    )


def _attitudes(solution: Solution) -> int:
    """Count attitudes in which measurements were taken, up to the least that is enough."""
    C = solution.last.output.C_nb[solution.reduced.phases.used]
    count = 0
    while len(C) and count < _LEAST_ATTITUDES:
        count += 1
        cosine = 0.5 * (np.einsum("kij,ij->k", C, C[0]) - 1.0)
        C = C[cosine < _SAME]
    return count
