"""The begin of a turn is no rest, at whatever rate the IMU is sampled."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rate_table_sim.core import TableSpecification
from sdimu_calibration.core.data.static_detection import detect_static, hides_earth_rate
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.files.config import load_imu, load_plan
from sdimu_sim.core.scenario import Scenario, generate

SITE = Site(math.radians(36.4), 0.0)
DWELL_S = 100.0
"""Length of a dwell of kim18 (s); the table runs up to 1 deg/s in one second more."""


@pytest.mark.parametrize("name", ["mems_consumer", "mems_industrial"])
@pytest.mark.parametrize("rate_hz", [20.0, 100.0, 200.0])
def test_rests_are_the_dwells_and_their_noise_is_that_of_the_sensor(name, rate_hz):
    imu = load_imu(name)
    recording, _ = generate(
        Scenario(load_plan("kim18"), imu, SITE, TableSpecification(axes=None), rate_hz=rate_hz, seed=3)
    )
    rests = detect_static(recording)
    length = recording.t[rests.last - 1] - recording.t[rests.first]
    assert len(rests) == 19
    # 0.15 s of a ramp of 1 deg/s^2 turn by 0.01 deg: what a window of the noise of a cheap gyro is blind to.
    assert np.median(length) < DWELL_S + 0.3
    assert np.all(length > DWELL_S - 2.0)
    # 19 dwells give 3,800 pairs of means on three axes: the density to 1 %, with quantisation of the samples left out.
    assert rests.gyro_white_noise == pytest.approx(imu.gyro_white_noise, rel=0.05)
    assert rests.accel_white_noise == pytest.approx(imu.accel_white_noise, rel=0.05)
    assert not hides_earth_rate(recording, imu)
