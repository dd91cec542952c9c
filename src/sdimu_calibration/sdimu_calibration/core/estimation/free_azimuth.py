"""Does the noise that was learned hide the azimuth? Then the horizontal Earth rate is estimated in its place.

Earth rate at rest is seen as a vector that is constant in the room, the biases as one that is constant in the body. A
bias that wanders by 25 deg/h leaves the azimuth open by tens of degrees. A fit that is linear about the azimuth that
white noise gives is then wrong by five sigma and more in the gyro biases.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sdimu_calibration.core.effects.earth_rate import horizontal
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.evidence.noise_kernels import kernel, stretches
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.specification import ImuSpecification, Site

_LOST_RAD = 0.1
"""Sigma of the azimuth (rad) from which it is lost: at three sigma the first order of Earth rate is wrong by 4 % of it,
which is as much as the noise leaves of a gyro bias."""


def azimuth_is_lost(fit: Fit, terms: Sequence[NoiseTerm]) -> bool:
    """Tell whether noise hides the azimuth from a fit that estimates it.

    One whose site states the azimuth well enough knows it.

    Parameters
    ----------
    terms : sequence of NoiseTerm
        Noise with a memory that was learned.
    """
    if not isinstance(fit, NavigationFit) or fit.azimuth_free or not terms:
        return False
    return not _stated(fit.setup.site) and azimuth_sigma(fit, terms) > _LOST_RAD


def stated_noise_hides_azimuth(imu: ImuSpecification, site: Site) -> bool:
    """Tell whether the bias instability that an IMU file states hides the azimuth from any test at a site.

    No mean over a rest, however long, falls below it.

    Parameters
    ----------
    site : Site
        One that states the azimuth well enough hides nothing.
    """
    return not _stated(site) and imu.gyro_bias_instability > _LOST_RAD * horizontal(site.latitude_rad)


def _stated(site: Site) -> bool:
    return site.initial_azimuth_rad is not None and site.initial_azimuth_sigma_rad <= _LOST_RAD


def azimuth_sigma(fit: NavigationFit, terms: Sequence[NoiseTerm]) -> float:
    """Sigma of the azimuth by the mean rates at rest.

    Generalised least squares of gyro biases and horizontal Earth rate, all else known.

    Parameters
    ----------
    terms : sequence of NoiseTerm
        Noise with a memory, beside the white noise of the IMU file.

    Returns
    -------
    float
        rad; infinite where the attitudes do not tell Earth rate from the biases.
    """
    cut = stretches(fit.timetable)
    rest = np.flatnonzero(~cut.turning)
    noise = np.diag(fit.setup.imu.gyro_white_noise**2 / (cut.end - cut.start)[rest])
    for term in terms:
        if term.triad == "gyro":
            noise = noise + term.size**2 * kernel(term.kind, term.tau, cut)[np.ix_(rest, rest)]
    epochs = fit.prepared.epochs
    middle = np.searchsorted(epochs.end, 0.5 * (cut.start + cut.end)[rest])
    C_nb = fit.last.output.C_nb[np.minimum(middle, len(epochs.end) - 1)]
    columns = np.concatenate([np.broadcast_to(np.eye(3), C_nb.shape), C_nb[:, :2, :].transpose(0, 2, 1)], axis=2)
    white = np.linalg.solve(np.linalg.cholesky(noise), columns.reshape(len(rest), -1)).reshape(-1, columns.shape[2])
    if np.linalg.matrix_rank(white) < columns.shape[2]:
        return float("inf")
    covariance = np.linalg.inv(white.T @ white)
    return float(np.sqrt(0.5 * np.trace(covariance[3:, 3:]))) / horizontal(fit.setup.site.latitude_rad)
