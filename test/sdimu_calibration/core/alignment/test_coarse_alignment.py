"""The coarse start finds attitude and biases from nothing but the stops."""

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.alignment.coarse_alignment import coarse_start
from sdimu_calibration.core.alignment.prepared import first_attitude, reduce, set_up
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.rotation import rotation_matrix, rotation_vector
from sdimu_calibration.core.units import to_si
from sdimu_calibration.storage.files.config import load_plan
from sdimu_sim.core.scenario import Scenario, generate

KIM18 = load_plan("kim18")
MOUNT = (0.03, -0.05, 0.02)


def start_of(recording, site, imu, model):
    setup = set_up(site, imu, model)
    prepared = reduce(recording, setup)
    return coarse_start(prepared, setup, first_attitude(prepared.epochs, prepared.phases, setup)), setup


@pytest.mark.parametrize("azimuth_deg", [0.0, 60.0, 120.0, 180.0])
def test_attitude_does_not_follow_a_wrong_azimuth(imu, model, site, azimuth_deg):
    recording, _ = generate(Scenario(KIM18, imu, site, seed=3, mount_rad=MOUNT, rate_hz=20.0))
    told = replace(site, initial_azimuth_rad=np.radians(azimuth_deg), initial_azimuth_sigma_rad=np.radians(104.0))
    found, _ = start_of(recording, told, imu, model)
    off = rotation_vector(found.C_nb @ rotation_matrix(np.array(MOUNT)).T)
    # Bias and mass unbalance of a degree an hour against 12 deg/h of Earth rate, told apart at 19 stops.
    assert np.linalg.norm(off) < np.radians(3.0)


def test_bias_of_a_degree_a_second_is_found_to_the_size_of_earth_rate(imu, model, site):
    rough = replace(imu, prior={**imu.prior, "gyro_bias": to_si(1, "deg/s")}, grade="mems")
    recording, truth = generate(Scenario(KIM18, rough, site, seed=4, mount_rad=MOUNT, rate_hz=20.0))
    found, setup = start_of(recording, site, rough, model)
    for name in ("gyro_bias_x", "gyro_bias_y", "gyro_bias_z"):
        error = found.coefficients[setup.sensors.names.index(name)] - truth.imu.coefficients[name]
        assert abs(error) < to_si(5, "deg/h"), name


def test_two_stops_keep_the_alignment(imu, model, site):
    plan = Plan("one turn", (30.0, 30.0), KIM18.turns[:1], KIM18.acceleration_rad_s2)
    recording, _ = generate(Scenario(plan, imu, site, seed=4, rate_hz=20.0))
    setup = set_up(site, imu, model)
    prepared = reduce(recording, setup)
    start = first_attitude(prepared.epochs, prepared.phases, setup)
    found = coarse_start(prepared, setup, start)
    assert np.array_equal(found.C_nb, start.C_nb)
    assert not found.coefficients.any()
