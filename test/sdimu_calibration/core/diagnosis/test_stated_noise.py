"""Noise with a memory that the IMU's file states is no fault of the file."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sdimu_calibration.core.diagnosis.measured_noise import is_stated
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.storage.files.config import load_imu

IMU = replace(load_imu("mems_consumer"), gyro_bias_instability=1e-4, accel_bias_instability=None)


@pytest.mark.parametrize(
    ("term", "stated"),
    [
        (NoiseTerm("gyro", "flicker", 0.0, 1.1e-4, 0.9e-4, 1.3e-4), True),
        (NoiseTerm("gyro", "flicker", 0.0, 1.5e-4, 1.2e-4, 1.8e-4), False),
        (NoiseTerm("gyro", "flicker", 0.0, 0.5e-4, 0.3e-4, 0.8e-4), False),
        (NoiseTerm("gyro", "markov", 300.0, 1.0e-4, 0.9e-4, 1.3e-4), False),
        (NoiseTerm("accel", "flicker", 0.0, 1.0e-4, 0.9e-4, 1.3e-4), False),
    ],
)
def test_a_term_is_stated_where_its_interval_holds_the_size_of_the_file(term, stated):
    assert is_stated(term, IMU) is stated
