"""A test that chooses its turns: one sensor and one noise throughout, limits that hold at its end."""

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.adaptive import Menu
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan, load_site
from sdimu_calibration.storage.files.goal_file import load_goals
from sdimu_calibration.storage.files.table_file import load_rate_table
from sdimu_sim.core.scenario import Scenario, imu_truth
from sdimu_study.adaptive_test import FIRST_STOP_S, adaptive_test
from sdimu_study.worlds import simulate

SCENARIO = Scenario(load_plan("kim18"), load_imu("dtg"), load_site("daejeon"), rate_hz=20.0, seed=11)


@pytest.fixture(scope="module")
def done():
    return adaptive_test(
        SCENARIO,
        imu_truth(SCENARIO),
        load_rate_table("ideal"),
        load_model("baseline"),
        load_goals("table33"),
        Menu(),
        60.0,
    )


def test_samples_made_stop_by_stop_are_those_of_the_same_plan_made_at_once(done):
    recording = done.last.found.fit.test.recording
    whole = simulate(replace(SCENARIO, plan=done.plan), imu_truth(SCENARIO))
    np.testing.assert_array_equal(recording.omega_ib_b, whole.omega_ib_b)
    np.testing.assert_array_equal(recording.f_ib_b, whole.f_ib_b)
    np.testing.assert_array_equal(recording.phase.stop, whole.phase.stop)


def test_it_ends_with_all_limits_held_by_the_sigmas_of_the_fit_in_less_time_than_any_fixed_plan(done):
    assert done.end.reached
    assert (done.last.known.ratio <= 1.0).all()
    assert done.plan.duration_s < 0.5 * load_plan("recommended").duration_s
    fit = done.last.found.extended.with_doubt(None)
    limited, limit = load_goals("table33").of(fit.names, fit.body_frame)
    assert (np.sqrt(np.diag(fit.covariance))[limited] <= limit).all()


def test_every_choice_has_its_reason_and_its_time(done):
    times = [minutes for minutes, _ in done.choices]
    assert times == sorted(times)
    assert all("limit" in choice.reason for _, choice in done.choices)
    total = FIRST_STOP_S / 60.0 + sum(choice.minutes for _, choice in done.choices)
    assert total == pytest.approx(done.plan.duration_s / 60.0, abs=0.02)


def test_every_axis_is_turned_in_both_senses(done):
    senses = {(turn.axis, turn.angle_rad > 0.0) for turn in done.plan.turns}
    assert senses == {(axis, sense) for axis in "XYZ" for sense in (True, False)}
