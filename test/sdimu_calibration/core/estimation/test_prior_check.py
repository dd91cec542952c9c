"""A stated prior that contradicts the data is told; one that agrees, or that the data do not touch, is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sdimu_calibration.core.effects.imu_model import ImuModel
from sdimu_calibration.core.estimation.prior_check import contradicted
from sdimu_calibration.core.planning.predict import prepare
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan, load_site


def stated(name: str, mean: float, sigma: float) -> tuple[ImuModel, int]:
    """Sensors whose model states one prior (SI), and its place."""
    place = load_plan("kim18"), load_site("daejeon"), load_imu("dtg"), load_model("baseline")
    sensors = prepare(*place, None, None).setup.sensors
    k = sensors.names.index(name)
    means, prior, restated = sensors.mean.copy(), sensors.prior.copy(), sensors.restated.copy()
    means[k], prior[k], restated[k] = mean, sigma, True
    return replace(sensors, mean=means, prior=prior, restated=restated), k


def test_a_stated_prior_that_the_data_pull_far_away_is_told_and_no_other():
    sensors, k = stated("gyro_scale_y", -2000e-6, 10e-6)
    covariance = np.diag((0.1 * sensors.prior) ** 2)
    told = contradicted(sensors, np.where(np.arange(len(sensors.prior)) == k, -200e-6, sensors.mean), covariance)
    assert len(told) == 1
    assert "gyro_scale_y (-2000 +- 10 ppm)" in told[0]
    # 1800 ppm over the 9.95 ppm that a fit at a tenth of the prior's sigma takes away; data alone are 100/99 so far.
    assert "-181.8 ppm, 181 sigma" in told[0]


def test_chance_and_data_that_say_nothing_are_not_told():
    sensors, k = stated("gyro_scale_y", 100e-6, 10e-6)
    estimate = sensors.mean.copy()
    estimate[k] += 25e-6
    assert contradicted(sensors, estimate, np.diag((0.1 * sensors.prior) ** 2)) == []
    assert contradicted(sensors, sensors.mean, np.diag(sensors.prior**2)) == []


def test_a_prior_of_the_imu_file_is_left_to_the_check_of_the_specification():
    sensors, k = stated("gyro_scale_y", 0.0, 10e-6)
    estimate = np.zeros(len(sensors.prior))
    estimate[k] = 1e-3
    free = replace(sensors, restated=np.zeros_like(sensors.restated))
    assert contradicted(free, estimate, np.diag((0.1 * sensors.prior) ** 2)) == []
