"""A test of a day: nothing wears out."""

import numpy as np
import pytest
from scipy.stats import chi2

from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan, load_site
from sdimu_sim.core.scenario import Scenario, generate
from sdimu_sim.core.truth import in_body_frame

REPEATS = 30
PINNED = ("accel_misalignment_xy", "accel_misalignment_xz", "accel_misalignment_yx")


@pytest.mark.slow
@pytest.mark.timeout(0)
def test_covariance_stays_symmetric_and_positive_and_errors_honest_over_a_day():
    plan, imu, site, model = load_plan("kim18"), load_imu("dtg"), load_site("daejeon"), load_model("baseline")
    day = Plan("a day", (100.0,) * (18 * REPEATS + 1), plan.turns * REPEATS, plan.acceleration_rad_s2)
    assert day.duration_s > 24 * 3600.0
    recording, truth = generate(Scenario(day, imu, site, seed=1, rate_hz=20.0))
    for estimator in ("filter", "batch"):
        found = calibrate(recording, site, imu, model, held_out=False, estimator=estimator)
        true = in_body_frame(truth.imu.coefficients, found.body_frame)
        k = [i for i, name in enumerate(found.names) if name not in PINNED]
        sigma = np.sqrt(np.diag(found.covariance))[k]
        correlation = found.covariance[np.ix_(k, k)] / np.outer(sigma, sigma)
        np.testing.assert_allclose(correlation, correlation.T, atol=1e-12)
        assert np.linalg.eigvalsh(correlation).min() > 0.0
        z = np.array([found.values[i] - true[found.names[i]] for i in k]) / sigma
        assert chi2.ppf(5e-4, len(k)) < z @ np.linalg.solve(correlation, z) < chi2.ppf(1.0 - 5e-4, len(k))
