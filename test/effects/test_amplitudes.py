"""Effects of jerk and delay come back with their size, from turns that start and stop within a few cycles."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.core.units import to_si
from sdimu_calibration.storage.files.config import load_imu, load_plan, load_site
from sdimu_calibration.storage.files.effect_file import extended_model
from sdimu_sim.core.scenario import Scenario, generate

HIDDEN = {
    "gyro_acceleration_sensitivity_xx": (2.5e-4, "2.5e-4 s"),
    "gyro_delay_x": (to_si(0.3, "ms"), "0.3 ms"),
    "accel_delay_y": (to_si(0.2, "ms"), "0.2 ms"),
}


@pytest.mark.parametrize("name", HIDDEN)
def test_a_perfect_test_with_fast_turns_gives_the_size_back(name):
    # Ramps of half a second are five cycles: what is left is the second order of a cycle against a turn.
    size, text = HIDDEN[name]
    site, imu = load_site("daejeon"), load_imu("dtg")
    perfect = replace(imu, gyro_white_noise=0.0, accel_white_noise=0.0)
    scenario = Scenario(
        load_plan("recommended"),
        perfect,
        site,
        seed=4,
        rate_hz=20.0,
        mount_rad=(0.02, 0.03, -0.03),
        coefficients={},
        effects=(f"{name}={text}",),
    )
    result = calibrate(generate(scenario)[0], site, imu, extended_model("baseline", [name]), held_out=False)
    assert result.values[result.names.index(name)] == pytest.approx(size, rel=0.01)
