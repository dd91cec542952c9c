"""The initial attitude of a recording whose coefficients another estimate gives."""

from __future__ import annotations

from sdimu_calibration.core.alignment.alignment import Alignment
from sdimu_calibration.core.alignment.prepared import PreparedData, TestSetup
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.filter.passes import loosened, misfits, one_pass

_ATTITUDE_PASSES = 3
"""Number of passes that let position and velocity go: each leaves the square of the attitude's error: of a degree
nothing."""


def attitude_about(
    prepared: PreparedData, setup: TestSetup, start: Alignment, C_nb: Floats, reference: Floats
) -> Floats:
    """Find the initial attitude where the coefficients are given.

    The coarse azimuth of uncalibrated gyros may be wrong by a degree; position and velocity would pin a pass near
    it, as in `passes.refine`.

    Parameters
    ----------
    C_nb : ndarray, shape (3, 3)
        Initial attitude to begin with, b to n (dimensionless).
    reference : ndarray, shape (p,)
        Coefficients (SI).

    Returns
    -------
    ndarray, shape (3, 3)
        `C_nb` itself where it fits.
    """
    if not misfits(one_pass(prepared, setup, start, C_nb, reference, closed_loop=False)):
        return C_nb
    for _ in range(_ATTITUDE_PASSES):
        C_nb = one_pass(prepared, loosened(setup), start, C_nb, reference, closed_loop=False).smoothed_start
    return C_nb
