"""The perfect recording shows the stops of the paper, and what its geometry says in turns."""

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core import earth
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.planning.nominal import nominal_recording, ramp_length, turned
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.rotation import rotation_matrix
from sdimu_calibration.storage.files.config import load_plan
from sdimu_sim.core.scenario import Scenario, generate

# Directions of X, Y, Z at the 19 stops as Kim, Song & Lyou print them.
STOPS = (
    "NED",
    "UEN",
    "DES",
    "UEN",
    "EDN",
    "WUN",
    "EDN",
    "ENU",
    "ESD",
    "ENU",
    "EUS",
    "ESD",
    "EDN",
    "DWN",
    "WUN",
    "UEN",
    "SEU",
    "DES",
    "NED",
)
DIRECTION = {"N": (1, 0, 0), "S": (-1, 0, 0), "E": (0, 1, 0), "W": (0, -1, 0), "D": (0, 0, 1), "U": (0, 0, -1)}


def middle_of_stops(plan):
    lengths = [abs(t.angle_rad) / t.rate_rad_s for t in plan.turns]
    starts = np.concatenate([[0.0], np.cumsum(np.array(plan.dwell_s[:-1]) + lengths)])
    return starts + 0.5 * np.array(plan.dwell_s)


def test_stops_are_those_that_the_paper_prints(site):
    plan = load_plan("kim18")
    recording = nominal_recording(plan, site)
    gravity = float(earth.normal_gravity(site.latitude_rad, site.height_m))
    at = np.searchsorted(recording.t, middle_of_stops(plan))
    for k, (row, letters) in enumerate(zip(at, STOPS, strict=True)):
        C_nb = np.array([DIRECTION[letter] for letter in letters], dtype=float).T
        np.testing.assert_allclose(recording.f_ib_b[row], -gravity * C_nb[2], atol=1e-11, err_msg=f"stop {k}")
        np.testing.assert_allclose(
            recording.omega_ib_b[row], C_nb.T @ earth.earth_rate(site.latitude_rad), atol=1e-17, err_msg=f"stop {k}"
        )


def test_agrees_with_the_simulator_that_is_written_apart(site, imu):
    # Ramps of the simulated table are rounded to its grid; at 50 deg/s^2 and 10 deg/s they fall on it.
    turns = (Turn("Y", np.radians(90.0), np.radians(10.0)), Turn("Z", np.radians(-90.0), np.radians(10.0)))
    length = 9.0
    ramp = 1.0
    acceleration = np.radians(90.0) / (ramp * (length - ramp))
    plan = Plan("two turns", (5.0, 5.0, 5.0), turns, acceleration)
    quiet = replace(imu, gyro_white_noise=0.0, accel_white_noise=0.0)
    mount = np.radians([1.0, -2.0, 3.0])
    simulated, _ = generate(Scenario(plan, quiet, site, coefficients={}, mount_rad=tuple(mount), rate_hz=20.0))
    ours = nominal_recording(plan, site, mount)
    # The simulator interpolates the table's 100 Hz motion; both take means of three Gauss nodes.
    np.testing.assert_allclose(ours.omega_ib_b, simulated.omega_ib_b, atol=1e-9)
    np.testing.assert_allclose(ours.f_ib_b, simulated.f_ib_b, atol=1e-7)


def test_trapezoid_makes_its_angle_at_its_mean_rate_within_its_acceleration():
    turn = Turn("X", np.radians(-180.0), np.radians(2.0))
    ramp = ramp_length(turn, np.radians(1.0), 1)
    t = np.linspace(0.0, 90.0, 90_001)
    angle, rate = turned(t, turn, ramp)
    assert angle[0] == 0.0
    assert angle[-1] == turn.angle_rad
    # A central difference across a kink of the rate is wrong by at most acceleration times step.
    np.testing.assert_allclose(np.gradient(angle, t)[1:-1], rate[1:-1], atol=np.radians(1.0) * 1e-3)
    assert np.max(np.abs(np.gradient(rate, t))) <= np.radians(1.0) * (1.0 + 1e-9)


def test_mount_turns_the_sensors_and_not_the_table(site):
    plan = load_plan("kim18")
    mount = np.radians([2.0, 1.0, -3.0])
    straight, turned_imu = nominal_recording(plan, site), nominal_recording(plan, site, mount)
    C_tb = rotation_matrix(mount)
    np.testing.assert_allclose(turned_imu.f_ib_b @ C_tb.T, straight.f_ib_b, atol=1e-11)


def test_turn_that_needs_more_acceleration_is_refused_by_number(site):
    plan = Plan("hasty", (5.0, 5.0), (Turn("X", np.pi, np.radians(90.0)),), np.radians(10.0))
    with pytest.raises(DataError, match="turn 1"):
        nominal_recording(plan, site)


def test_plan_without_turns_is_one_rest(site):
    recording = nominal_recording(Plan("rest", (30.0,), (), 1.0), site)
    assert recording.t[-1] == pytest.approx(30.0)
    assert np.ptp(recording.f_ib_b, axis=0).max() == 0.0


def test_a_first_stop_too_short_to_level_at_is_named(site):
    plan = load_plan("kim18")
    with pytest.raises(DataError, match=r"first stop of 0\.5 s"):
        nominal_recording(replace(plan, dwell_s=(0.5,) * len(plan.dwell_s)), site)
