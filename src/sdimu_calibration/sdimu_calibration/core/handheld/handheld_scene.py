"""What is known before the fit of a run by hand, and where the fit begins."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.alignment.alignment import levelled
from sdimu_calibration.core.arrays import Bools
from sdimu_calibration.core.data.static_detection import StaticIntervals
from sdimu_calibration.core.effects import body_frame
from sdimu_calibration.core.effects.bias import GYRO_BIAS
from sdimu_calibration.core.effects.imu_model import ImuModel, has_stated_priors
from sdimu_calibration.core.handheld.handheld_data import HandheldRun, turns
from sdimu_calibration.core.handheld.handheld_fit import FitPriors, LinearisationPoint
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import ImuSpecification, Site
from sdimu_calibration.core.units import STANDARD_GRAVITY

_LEAST_NOISE = 0.01
"""Share of the specification's noise below which learned noise is not believed: a few rests may agree by chance."""
_ROOM = 30.0
"""Factor on the prior of the class where the IMU's file gives none: held back by a prior, an added effect would be
learned as scatter."""


def fit_priors(sensors: ImuModel, imu: ImuSpecification, site: Site | None, rests: StaticIntervals) -> FitPriors:
    """Say what is known before the fit."""
    changing = (sensors.decay_rate > 0) | (sensors.drive > 0)
    if changing.any():
        name = sensors.names[int(np.argmax(changing))]
        raise DataError(f"a handheld run takes constants only, and '{name}' changes at random: leave it out")
    # The prior holds in a frame of its own; the three turns that lead to the accelerometers' frame go with it.
    J = body_frame.frame_jacobian(sensors.names, "accelerometer_triad")
    size = sensors.prior * np.where(_stated(sensors, imu) | sensors.restated, 1.0, _ROOM)
    prior = J @ np.diag(size**2) @ J.T
    kept = np.flatnonzero(np.diag(prior) > 1e-12 * size**2)
    gravity, mean, sigma = STANDARD_GRAVITY, np.zeros(3), np.full(3, earth.RATE / np.sqrt(3.0))
    if site is not None:
        gravity = site.gravity_m_s2 or float(earth.normal_gravity(site.latitude_rad, site.height_m))
        rate = earth.earth_rate(site.latitude_rad)
        mean[2] = rate[2]
        # The heading is free, so north is any way; 1e-9 rad/s is a ten-thousandth of a degree an hour.
        down = max(1e-9, abs(rate[0]) * site.astronomic_latitude_sigma_rad)
        sigma = np.array([abs(rate[0]) / np.sqrt(2.0) + 1e-9, abs(rate[0]) / np.sqrt(2.0) + 1e-9, down])
    return FitPriors(
        sensors,
        kept,
        prior[np.ix_(kept, kept)],
        gravity,
        mean,
        sigma,
        max(rests.gyro_white_noise, _LEAST_NOISE * imu.gyro_white_noise),
        max(rests.accel_white_noise, _LEAST_NOISE * imu.accel_white_noise),
    )


def _stated(sensors: ImuModel, imu: ImuSpecification) -> Bools:
    """Which coefficients have a prior in the IMU's own file."""
    return np.array([stated for effect in sensors.effects for stated in has_stated_priors(effect, imu)], dtype=bool)


def first_linearisation(run: HandheldRun, sensors: ImuModel, gravity: float) -> LinearisationPoint:
    """Begin with the mean rate at rest as bias; gyros lead from rest to rest, and every rest is levelled."""
    coefficients = np.zeros(len(sensors.prior))
    for name, value in zip(GYRO_BIAS.labels, np.median(run.mean[:, :3], axis=0), strict=True):
        if name in sensors.names:
            coefficients[sensors.names.index(name)] = value
    k = len(run.t)
    turned = turns(run, sensors, coefficients, np.repeat(np.eye(3)[None], k, axis=0), gravity).C_nb
    C_nb = [levelled(np.eye(3), run.mean[0, 3:])]
    for i in range(k - 1):
        C_nb.append(levelled(C_nb[-1] @ turned[i], run.mean[i + 1, 3:]))
    return LinearisationPoint(coefficients, np.array(C_nb), np.zeros(3), np.zeros(3))
