"""What a fit by passes says of its azimuth: too little known, not observable, or not estimated at all."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.alignment.prepared import PreparedData, TestSetup
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.bias import GYRO_BIAS
from sdimu_calibration.core.filter.filter_pass import NAV
from sdimu_calibration.core.filter.pass_loop import Pass
from sdimu_calibration.core.note import Note, Topic
from sdimu_calibration.core.results import NOT_TRUSTED
from sdimu_calibration.core.units import from_si

NO_AZIMUTH = (
    "the noise that was learned hides the azimuth: the horizontal Earth rate was estimated in its place; the "
    "coefficients do not need the azimuth, headings of this test mean nothing"
)
"""Note on a fit that does without the azimuth."""
_SIGMAS = 3.0
"""Error of the azimuth (sigma) that is reckoned with: chance ends there."""
_LEAST_ATTITUDES = 3
"""Number of attitudes from which azimuth and gyro biases come apart: with fewer the sigmas themselves are bent."""
_NO_HEADING_RAD = np.radians(1.0)
"""Error of the azimuth (rad) from which it is called not observable: a heading so wrong is of no use."""
_SAME = np.cos(np.radians(10.0))
"""Cosine of a rotation (1) above which two attitudes are one: 10 deg are less than any step of a plan."""


def azimuth_warning(setup: TestSetup, prepared: PreparedData, last: Pass) -> str | None:
    """Say so when there are too few attitudes, or the second order of the azimuth exceeds the sigma of a gyro bias.

    A wrong azimuth a turns the horizontal Earth rate, O = 7.29e-5 rad/s times the cosine of latitude. The filter counts
    the first order, O a, across; along, the second order O a^2 / 2 is missing in it and goes into the gyro biases,
    whatever their sigma says. Where Earth rate has been seen from many attitudes the azimuth is known to an arcminute
    and this is nothing; after one or two stops it is known only as well as a gyro bias, and the estimate is bent.

    The second order is taken at three sigma, against the smallest sigma of a bias. With one or two attitudes the
    sigmas themselves are bent, and only the attitudes are counted.
    """
    attitudes = _attitudes(last.output.C_nb[prepared.phases.used])
    if attitudes < _LEAST_ATTITUDES:
        told = (
            f"the IMU was at rest in {attitudes} attitude{'s' if attitudes > 1 else ''} only: azimuth and gyro biases "
            f"cannot be separated, and their sigmas are {NOT_TRUSTED}; use a plan with more attitudes"
        )
        return Note(told, Topic.NOT_TRUSTED)
    sigma = np.sqrt(np.diag(last.state.P))
    biases = [sigma[NAV + i] for i, name in enumerate(setup.sensors.names) if name in GYRO_BIAS.labels]
    if not biases:
        return None
    azimuth = float(sigma[-1])
    bent = 0.5 * (_SIGMAS * azimuth) ** 2 * earth.RATE * float(np.cos(setup.site.latitude_rad))
    if bent <= min(biases):
        return None
    return (
        f"the azimuth is known only to {np.degrees(azimuth):.2g} deg: gyro biases may be wrong by "
        f"{from_si(bent, 'deg/h'):.2g} deg/h beyond their sigma; use a plan with more attitudes"
    )


def azimuth_note(setup: TestSetup, last: Pass) -> str | None:
    """Say so where the Earth turns about the vertical so nearly that no heading can come from it.

    What a gyro bias leaves open of the horizontal Earth rate is an azimuth. The filter's own sigma does not show it:
    the second order of an azimuth that may be anything is taken for knowledge. An azimuth that a site states is known.
    """
    site = setup.site
    biases = [k for k, name in enumerate(setup.sensors.names) if name in GYRO_BIAS.labels]
    if site.initial_azimuth_rad is not None or not biases:
        return None
    bias = float(np.sqrt(min(np.diag(last.covariance)[biases])))
    horizontal = earth.RATE * abs(float(np.cos(site.latitude_rad)))
    if bias <= _NO_HEADING_RAD * horizontal:
        return None
    return (
        f"the azimuth is not observable: at latitude {np.degrees(site.latitude_rad):.4g} deg the horizontal Earth rate "
        f"is {from_si(horizontal, 'deg/h'):.2g} deg/h, and the best gyro bias is known to "
        f"{from_si(bias, 'deg/h'):.2g} deg/h; "
        "the coefficients do not need it, but headings of this test mean nothing"
    )


def _attitudes(C: Floats) -> int:
    """Count the attitudes (e, 3, 3) that differ, up to the least that is enough."""
    count = 0
    while len(C) and count < _LEAST_ATTITUDES:
        count += 1
        cosine = 0.5 * (np.einsum("kij,ij->k", C, C[0]) - 1.0)
        C = C[cosine < _SAME]
    return count
