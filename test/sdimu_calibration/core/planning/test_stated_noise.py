"""The bias instability of an IMU file widens a prediction as it widens the fit of a test with that noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.estimation.noise_learning import in_noise
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.evidence.wander import Wander
from sdimu_calibration.core.planning.predict import predict
from sdimu_calibration.core.stated_noise import stated_noise
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan
from sdimu_sim.core.scenario import Scenario, generate

MODEL = load_model("baseline")


@pytest.mark.parametrize("name", ["rlg_navigation", "fog_tactical"])
def test_the_prediction_is_the_covariance_of_a_test_in_that_noise(site, name):
    imu, plan = load_imu(name), load_plan("kim18")
    found = predict(plan, site, imu, MODEL)
    recording, _ = generate(Scenario(plan, imu, site, rate_hz=20.0, seed=3))
    fit = solve(PreparedTest(recording, imu, site), MODEL, learn=False)
    real = np.sqrt(np.diag(in_noise(fit, stated_noise(imu), Wander.of(fit.bare)).covariance))
    assert fit.names == found.names
    free = real > 1e-6 * found.prior
    # The mount and the errors of the real IMU change the geometry by degrees at most.
    np.testing.assert_allclose(found.in_noise[free], real[free], rtol=0.1)
    assert (found.in_noise[free] > 0.999 * found.sigma[free]).all()
    assert (found.in_noise > 1.3 * found.sigma).any()


def test_what_states_no_memory_has_none(site):
    imu = replace(load_imu("dtg"), gyro_bias_instability=0.0, accel_bias_instability=0.0)
    found = predict(load_plan("kim18"), site, imu, MODEL)
    np.testing.assert_array_equal(found.in_noise, found.sigma)
