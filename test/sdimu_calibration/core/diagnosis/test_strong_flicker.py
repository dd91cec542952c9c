"""Flicker far above white noise within every stretch: no physics is named for it, and sigmas hold."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_study.score import errors
from sdimu_study.worlds import simulated_test

IMU = "mems_industrial"
NOISE = ("gyro_noise_flicker=18 deg/h", "accel_noise_flicker=210 ug")
"""Three times that of the data sheet."""
OF_THE_FILE = ("gyro_noise_flicker=6 deg/h", "accel_noise_flicker=70 ug")


def test_no_physics_is_named_for_what_moves_within_stretches():
    """Taken as its mean in every stretch, this noise was a sine and a step of over seven sigma."""
    test, sensor = simulated_test(IMU, load_imu(IMU), "kim18_10_min", Site(0.635), 90002, (), NOISE, 50.0)
    found = climb(solve(test, load_model("baseline")))
    assert found.probabilities is not None
    assert max((f.probability for f in found.probabilities.families), default=0.0) < 0.5
    assert {"gyro", "accel"} <= {one.triad for one in found.probabilities.noise if one.probability > 0.5}
    told = errors(found.after, sensor)
    # 27 errors over their sigmas, which hang together: three standard deviations of the mean square of half as many.
    assert told["z2"] / told["count"] < 1.0 + 3.0 * np.sqrt(2.0 / 13.0)


def test_an_effect_is_found_where_noise_that_follows_the_rate_took_it_up():
    """Beside no effect that noise was likelier by far, and the effect was looked for in it alone."""
    site, effects = Site(0.635), ("accel_bias_in_motion_x=500 ug",)
    test, _ = simulated_test(IMU, load_imu(IMU), "kim18_10_min", site, 3, effects, OF_THE_FILE)
    found = climb(solve(test, load_model("baseline")))
    assert [c.label for c in found.chosen] == ["accel_bias_in_motion_x"]
    assert found.may_be(int(found.found.chosen[0]))[0] > 0.95
    assert not found.unexplained
