"""What the filter on the way estimates: the coefficients asked for, and behind them what only serves.

What serves are references of the site that are not taken at their word, noise with a memory that the IMU file states,
and the horizontal Earth rate where that noise hides the azimuth.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.alignment.alignment import UNKNOWN_AZIMUTH, Alignment
from sdimu_calibration.core.alignment.prepared import TestSetup, set_up
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.effects.accelerometer_frame import squares_count
from sdimu_calibration.core.effects.earth_rate import EAST, with_any_direction
from sdimu_calibration.core.effects.imu_model import ImuModel, with_references
from sdimu_calibration.core.effects.references import stated_references
from sdimu_calibration.core.estimation.free_azimuth import stated_noise_hides_azimuth
from sdimu_calibration.core.filter.filter_pass import NAV, PassState
from sdimu_calibration.core.filter.noise_states import NoiseStates, with_noise_states
from sdimu_calibration.core.filter.pass_setup import NO_MEANS
from sdimu_calibration.core.front_door import OpeningOptions
from sdimu_calibration.core.specification import EPOCH_S, Model
from sdimu_calibration.core.stated_noise import stated_noise

NO_AZIMUTH = (
    "the bias instability that the IMU file states hides the azimuth: the filter on the way estimates the horizontal "
    "Earth rate in its place, and its headings mean nothing"
)
"""Note on a filter on the way that does without the azimuth."""
SQUARES = (
    "squares of the errors of this IMU count: in the first five stops sigmas on the way may be too small; "
    "the filter looks back on them with what it knows by then, and the end of the test sees everything"
)
"""Note on a filter on the way that knows large errors to first order until its passes have seen some stops."""


@dataclass(frozen=True)
class LiveModel:
    """Model of the filter on the way."""

    asked: ImuModel
    """Coefficients that are reported, p of them."""
    setup: TestSetup
    """With all that is estimated, q parameters."""
    noise: NoiseStates | None
    """Where noise with a memory stands among them."""
    azimuth_free: bool
    """The horizontal Earth rate is estimated in the place of the azimuth."""

    @property
    def averaged(self) -> Ints:
        """States of noise and their means, as `PassSettings.averaged` has them, shape (w, 2)."""
        return NO_MEANS if self.noise is None else self.noise.averaged

    @property
    def constant(self) -> Floats:
        """1 of what is a constant of the test, 0 of what fades or wanders, and of its mean, shape (q,)."""
        sensors = self.setup.sensors
        constant = (sensors.decay_rate == 0.0) & (sensors.drive == 0.0)
        if self.noise is not None:
            constant[self.noise.mean] = False
        return np.asarray(constant.astype(np.float64))

    @property
    def notes(self) -> list[str]:
        """What a user should know of the estimates on the way."""
        hidden = [NO_AZIMUTH] if self.azimuth_free else []
        return hidden + ([SQUARES] if squares_count(self.asked) else [])

    def begun(self, alignment: Alignment) -> Alignment:
        """Take the azimuth of the first attitude for a convention where it is not estimated."""
        return alignment.with_azimuth_of(alignment.C_nb) if self.azimuth_free else alignment

    def coefficients(self, state: PassState) -> tuple[Floats, Floats]:
        """Read the coefficients asked for, biases with the mean of their noise over the rests so far.

        Returns
        -------
        values : ndarray, shape (p,)
            SI, in the frame of the prior.
        covariance : ndarray, shape (p, p)
        """
        p, q = len(self.asked.prior), len(self.setup.sensors.prior)
        estimate, P = state.used + state.x[NAV : NAV + q], state.P[NAV : NAV + q, NAV : NAV + q]
        if self.noise is None:
            return estimate[:p], P[:p, :p]
        moved = self.noise.moved[:p]
        return moved @ estimate, moved @ P @ moved.T

    def navigation_covariance(self, state: PassState) -> Floats:
        """Read the covariance of position (m), velocity (m/s) and attitude (rad), shape (9, 9).

        A free azimuth has what the Earth's rate leaves open of it.
        """
        P = state.P[:NAV, :NAV].copy()
        if self.azimuth_free:
            east = self.setup.sensors.names.index(EAST)
            left = float(state.P[NAV + east, NAV + east]) / self.setup.sensors.prior[east] ** 2
            P[8, 8] += min(left, 1.0) * UNKNOWN_AZIMUTH**2
        return P


def live_model(options: OpeningOptions, model: Model) -> LiveModel:
    """Put together what the filter on the way estimates.

    `options`: the IMU file may state noise with a memory, the site how far it is to be trusted; `model`: with p
    coefficients.
    """
    setup = set_up(options.site, options.imu, model, EPOCH_S)
    sensors = with_references(setup.sensors, stated_references(options.site))
    azimuth_free = stated_noise_hides_azimuth(options.imu, options.site)
    if azimuth_free:
        sensors = with_any_direction(sensors, options.site.latitude_rad)
    sensors, noise = with_noise_states(sensors, stated_noise(options.imu))
    return LiveModel(setup.sensors, replace(setup, sensors=sensors), noise, azimuth_free)
