"""One run: the recording is the simulator's, the truth is joined by name, NEES and lag products by definition."""

from dataclasses import replace

import numpy as np
import pytest

from rate_table_sim.core import TableSpecification
from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.storage.files.config import load_imu, load_model, load_site
from sdimu_sim.core import Scenario, generate, imu_truth, in_body_frame
from sdimu_study.monte_carlo import CHANNELS, STUDY, Campaign, lag_one, nees
from sdimu_study.worlds import simulate

PLAN = Plan("short", (12.0,) * 4, tuple(Turn(a, np.pi / 2, np.radians(15)) for a in "YZX"), np.radians(30))
MODEL = load_model("baseline")
SCENARIO = Scenario(PLAN, load_imu("dtg"), load_site("daejeon"), TableSpecification(axes=None), rate_hz=50.0)


def test_a_run_simulates_what_the_simulator_gives():
    scenario = replace(SCENARIO, seed=11, effects=("accel_quadratic_x=20 ug/g^2",))
    expected, truth = generate(scenario)
    sensor = imu_truth(scenario)
    recording = simulate(scenario, sensor)
    assert sensor == truth.imu
    for name in ("t", "omega_ib_b", "f_ib_b"):
        np.testing.assert_array_equal(getattr(recording, name), getattr(expected, name))
    np.testing.assert_array_equal(recording.phase.dwell, expected.phase.dwell)
    assert recording.table is None


def test_a_run_is_the_calibration_of_its_recording_beside_its_truth():
    row = STUDY.of(Campaign(SCENARIO, MODEL))(7)
    scenario = replace(SCENARIO, seed=7)
    recording, truth = generate(scenario)
    result = calibrate(recording, scenario.site, scenario.imu, MODEL, held_out=False)
    np.testing.assert_array_equal(row["estimate"], result.values)
    np.testing.assert_array_equal(row["covariance"], result.covariance[np.tril_indices(30)])
    true = in_body_frame(truth.imu.coefficients, MODEL.body_frame)
    assert dict(zip(row["names"], row["truth"], strict=True)) == true
    assert row["nis"].sum() / row["nis_dof"].sum() == pytest.approx(result.fit["nis_mean"], rel=1e-12)
    assert len(row["lag1"]) == len(row["lag1_count"]) == len(CHANNELS)


def test_the_frame_takes_three_coefficients_away():
    row = STUDY.of(Campaign(SCENARIO, MODEL))(3)
    fixed = {name for name, free in zip(row["names"], row["free"], strict=True) if not free}
    assert fixed == {f"accel_misalignment_{pair}" for pair in ("xy", "xz", "yx")}


def test_nees_is_the_squared_distance_in_the_metric_of_the_covariance():
    rng = np.random.default_rng(0)
    root = np.diag([1.0, 1e-6, 1e3]) @ rng.standard_normal((3, 3))
    P = np.zeros((4, 4))
    P[:3, :3] = root @ root.T
    white = np.array([1.0, -2.0, 0.5])
    error = np.append(root @ white, 0.0)
    # |white|^2 by definition; the condition of the scaled covariance loses digits.
    assert nees(error, P, np.array([True, True, True, False])) == pytest.approx(white @ white, rel=1e-9)


def test_products_of_neighbours_stay_within_a_stop_and_between_measurements():
    z = np.full((6, 12), np.nan)
    z[:, 6] = [1.0, 2.0, 3.0, np.nan, 4.0, 5.0]
    products, count = lag_one(z, np.array([0, 0, 1, 1, 1, 1]))
    # 1*2 at stop 0; 2*3 crosses stops, 3 and 4 have a gap between them; 4*5 at stop 1.
    assert products[6] == 22.0
    assert count.tolist() == [0] * 6 + [2] + [0] * 5
