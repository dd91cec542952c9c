"""The study of cheap IMUs in flicker: each case is what its name says, and its sigmas hold."""

import pytest

from sdimu_calibration.storage.files.config import load_imu
from sdimu_study.flicker import CASES, STUDY, world


def test_every_case_differs_by_one_word_from_another():
    assert len(CASES) == 16
    assert {len(case) for case in CASES} == {4}


def test_three_times_is_three_times_what_the_file_states():
    case = ("mems_industrial", "three times", "kim18_10_min", "50 Hz")
    one = world(case, 153_901)
    assert one.test.recording.interval_s == pytest.approx(0.02)
    assert one.test.imu == load_imu("mems_industrial")
    assert one.sensor.noise == ("gyro_noise_flicker=18 deg/h", "accel_noise_flicker=210 ug")


def test_the_sigmas_hold():
    row = STUDY.of(("mems_industrial", "three times", "kim18_10_min", "50 Hz"))(153_902)
    assert row["count"] == 27
    # Twenty-seven errors over sigma: their root scatters by a seventh about one.
    assert 0.5 < (row["z2"] / row["count"]) ** 0.5 < 1.6
