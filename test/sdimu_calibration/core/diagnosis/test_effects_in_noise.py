"""Effects and noise with a memory, told apart on whole simulated tests."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.diagnosis.bootstrap import bootstrap
from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.estimation.outcome import outcome
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan
from sdimu_sim.core.scenario import Scenario, imu_truth
from sdimu_study.score import baseline_z
from sdimu_study.worlds import in_the_mean, simulate

FLICKER = ("gyro_noise_flicker=0.01 deg/h", "accel_noise_flicker=2 ug")


def world(effects=(), noise=(), seed=1, stops=19):
    plan = load_plan("kim18_signed")
    scenario = Scenario(
        replace(plan, dwell_s=plan.dwell_s[:stops], turns=plan.turns[: stops - 1]),
        load_imu("dtg"),
        Site(math.radians(36.4), 0.0),
        rate_hz=20.0,
        seed=seed,
        effects=effects,
        noise=noise,
    )
    sensor = imu_truth(scenario)
    recording = simulate(scenario, sensor)
    return PreparedTest(recording, scenario.imu, scenario.site), in_the_mean(sensor, recording, seed)


def rms_z(result, sensor):
    return float(np.sqrt(np.mean(baseline_z(result, sensor) ** 2)))


def test_an_effect_in_flicker_noise_is_named_and_the_noise_is_not():
    # The first stops show it beyond twenty of its sigmas.
    test, sensor = world(("accel_quadratic_x=60 ug/g^2",), FLICKER, stops=13)
    found = climb(solve(test, load_model("baseline")))
    assert [c.label for c in found.chosen] == ["accel_quadratic_x"]
    assert {term.triad for term in found.found.noise} == {"gyro", "accel"}
    # 27 errors over sigma of a right covariance scatter by 0.14 about one.
    assert 0.6 < rms_z(found.after, sensor) < 1.4
    # Draws of that noise score as noise: 150 independent scores a draw, four draws; their root scatters by 0.03.
    assert bootstrap(found, 4).rms_z == pytest.approx(1.0, abs=0.15)


def test_a_calibration_in_coloured_noise_has_the_sigma_that_its_errors_have():
    test, sensor = world((), FLICKER, seed=3)
    model = load_model("baseline")
    learned, white = solve(test, model), solve(test, model, learn=False)
    assert 0.6 < rms_z(outcome(learned), sensor) < 1.4
    assert rms_z(outcome(white), sensor) > 1.5
    assert any("the noise is not white" in note for note in outcome(learned).notes)


def test_the_mean_bias_does_not_hang_on_which_drift_it_is():
    test, sensor = world(("gyro_bias_ramp_x=0.2 deg/h/h",))
    model = load_model("baseline")
    means = []
    for drift in ("gyro_bias_ramp_x", "gyro_bias_warm_up_x(tau=2400 s)"):
        result = outcome(solve(test, replace(model, effects=(*model.effects, drift))))
        at = result.names.index("gyro_bias_x")
        sigma = np.sqrt(result.covariance[at, at])
        means.append(result.values[at])
        assert abs(result.values[at] - sensor.coefficients["gyro_bias_x"]) < 4.0 * sigma
        assert set(result.drift_means) == {result.names[-1]}
    assert abs(means[0] - means[1]) < 2.0 * sigma


@pytest.mark.slow
def test_thirty_tests_in_flicker_noise_name_no_effect_and_hold_their_sigma():
    false, squares = 0, []
    for seed in range(501, 531):
        test, sensor = world((), FLICKER, seed)
        found = climb(solve(test, load_model("baseline")))
        false += bool(found.chosen)
        squares.append(float(np.mean(baseline_z(found.after, sensor) ** 2)))
    assert false <= 3
    assert 0.85 <= np.sqrt(np.mean(squares)) <= 1.2
