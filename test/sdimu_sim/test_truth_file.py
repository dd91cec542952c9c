"""Truth files: the same recording can be made from them again, and other readers understand them."""

import numpy as np
import pytest
import yaml
from truth_reader import read_truth

from rate_table_sim.core import TableSpecification
from sdimu_calibration.core.units import STANDARD_GRAVITY
from sdimu_calibration.storage.files.config import load_imu, load_plan, load_site
from sdimu_calibration.storage.files.reference_file import read_truth as read_reference_truth
from sdimu_sim.core import ImuTruth, Scenario, in_body_frame
from sdimu_sim.core.by_hand import against_gravity
from sdimu_sim.core.generator import gravity_of
from sdimu_sim.core.scenario import imu_truth
from sdimu_sim.core.truth import Truth
from sdimu_sim.truth_file import write_truth


@pytest.fixture
def truth():
    scenario = Scenario(
        load_plan("kim18"),
        load_imu("dtg"),
        load_site("daejeon"),
        TableSpecification(),
        seed=11,
        effects=("accel_quadratic_x=20 ug/g^2", "gyro_z=0.1*deg/h*sin(t/400)"),
        extras={"gyro_limit_rad_s": 3.0},
    )
    return Truth(imu_truth(scenario), scenario.site, 11, 100.0, "kim18")


def test_a_truth_survives_its_file_to_the_last_digit(tmp_path, truth):
    write_truth(tmp_path / "truth.yaml", truth)
    back = read_truth(tmp_path / "truth.yaml")
    assert back.imu == truth.imu
    assert back.site.latitude_rad == pytest.approx(truth.site.latitude_rad, rel=1e-15)
    assert (back.seed, back.rate_hz, back.plan) == (11, 100.0, "kim18")


def test_the_file_gives_coefficients_by_name_in_both_frames_as_numbers(tmp_path, truth):
    write_truth(tmp_path / "truth.yaml", truth)
    content = yaml.safe_load((tmp_path / "truth.yaml").read_text())
    assert content["format"] == "sdimu-truth/1"
    for key, frame in (("coefficients", "prior"), ("coefficients_accelerometer_triad", "accelerometer_triad")):
        expected = in_body_frame(truth.imu.coefficients, frame)
        assert {n: content[key][n] for n in expected} == expected
        assert content[key]["accel_quadratic_x"] == pytest.approx(20e-6 * 9.80665)


@pytest.mark.parametrize("frame", ["prior", "accelerometer_triad"])
def test_the_calibrator_restates_it_for_another_gravity_as_the_simulator_does(tmp_path, frame):
    sensor = ImuTruth({"accel_scale_x": 0.02, "accel_misalignment_zx": 0.04, "gyro_misalignment_xy": 0.03})
    truth = Truth(sensor, load_site("daejeon"), 1, 100.0, "by hand")
    write_truth(tmp_path / "t.yaml", truth)
    stated = against_gravity(truth, STANDARD_GRAVITY, gravity_of(truth.site)).imu.coefficients
    found = read_reference_truth(tmp_path / "t.yaml", frame, STANDARD_GRAVITY)
    for name, value in in_body_frame(stated, frame).items():
        assert found[name] == pytest.approx(value, abs=1e-15)


def test_numbers_without_a_point_in_python_stay_numbers(tmp_path):
    # repr(1e-05) has no point, and YAML 1.1 then reads text.
    truth = Truth(ImuTruth({"gyro_bias_x": 1e-05}), load_site("daejeon"), 1, 100.0, "p")
    write_truth(tmp_path / "t.yaml", truth)
    assert isinstance(yaml.safe_load((tmp_path / "t.yaml").read_text())["as_built"]["gyro_bias_x"], float)
    assert np.isinf(read_truth(tmp_path / "t.yaml").imu.gyro_limit_rad_s)
