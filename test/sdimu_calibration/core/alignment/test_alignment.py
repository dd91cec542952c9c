"""Levelling and gyrocompassing, whatever way the IMU lies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sdimu_calibration.core import earth
from sdimu_calibration.core.alignment.alignment import UNKNOWN_AZIMUTH, align, azimuth_of
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.rotation import quaternion_matrix, rotation_matrix, rotation_vector
from sdimu_calibration.core.specification import Site

quaternions = st.tuples(*[st.floats(-1.0, 1.0)] * 4).map(np.array).filter(lambda q: np.linalg.norm(q) > 0.1)
FIXTURE = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])


def at_rest(C_nb, lat):
    w = C_nb.T @ earth.earth_rate(lat)
    return w, C_nb.T @ np.array([0.0, 0.0, -earth.normal_gravity(lat, 0.0)])


@FIXTURE
@given(quaternions, st.floats(-70.0, 70.0))
def test_a_perfect_imu_finds_any_attitude(imu, q, lat_deg):
    C_nb, lat = quaternion_matrix(q), np.radians(lat_deg)
    w, f = at_rest(C_nb, lat)
    found = align(w, f, 30.0, Site(lat), imu)
    np.testing.assert_allclose(found.C_nb, C_nb, rtol=0, atol=1e-13)
    assert np.linalg.det(found.C_nb) > 0.0
    assert (found.filter_sigma >= found.sigma).all()


@pytest.mark.parametrize("lat_deg", [36.4, -60.0])
def test_sigmas_of_the_alignment_are_honest(imu, lat_deg):
    """Errors drawn from the specification, any attitude: normalised errors about N, E, D have unit size."""
    rng = np.random.default_rng(1)
    lat = np.radians(lat_deg)
    p = imu.prior
    z = []
    for _ in range(600):
        C_nb = quaternion_matrix(rng.standard_normal(4))
        w, f = at_rest(C_nb, lat)
        # Any three numbers of these sizes: bias and noise of each gyro, bias and misalignments of each accelerometer.
        gyro = np.sqrt(p["gyro_bias"] ** 2 + p["gyro_mass_unbalance"] ** 2 + imu.gyro_white_noise**2 / 30.0)
        w = w + gyro * rng.standard_normal(3)
        f = f + np.hypot(p["accel_bias"], imu.accel_white_noise / np.sqrt(30.0)) * rng.standard_normal(3)
        f = f + 9.8 * p["accel_misalignment"] * rng.standard_normal(3)
        found = align(w, f, 30.0, Site(lat), imu)
        z.append(-rotation_vector(found.C_nb @ C_nb.T) / found.sigma)
    rms = np.sqrt(np.mean(np.square(z), axis=0))
    # 600 draws: 99.9 % within 10 %. Gravity-along errors do not count, so an honest sigma is not below that.
    assert (rms > 0.9).all(), rms
    assert (rms < 1.1).all(), rms


def test_at_the_pole_azimuth_is_unknown(imu):
    C_nb = rotation_matrix(np.array([0.3, -0.8, 2.0]))
    w, f = at_rest(C_nb, np.pi / 2)
    found = align(w, f, 30.0, Site(np.pi / 2), imu)
    assert found.sigma[2] == found.filter_sigma[2] == UNKNOWN_AZIMUTH
    # Level is known all the same.
    np.testing.assert_allclose(found.C_nb[2], C_nb[2], rtol=0, atol=1e-9)
    assert found.sigma[:2].max() < 1e-3


def test_a_poor_gyro_does_not_pretend_to_find_north(imu):
    poor = replace(imu, prior={**imu.prior, "gyro_bias": np.radians(100.0) / 3600.0})
    w, f = at_rest(np.eye(3), 0.6)
    found = align(w, f, 30.0, Site(0.6), poor)
    assert found.sigma[2] == UNKNOWN_AZIMUTH


@FIXTURE
@given(quaternions, st.floats(-np.pi, np.pi))
def test_the_azimuth_of_the_site_file_is_taken_over(imu, q, azimuth):
    C_nb, lat = quaternion_matrix(q), 0.6
    w, f = at_rest(C_nb, lat)
    site = Site(lat, initial_azimuth_rad=azimuth, initial_azimuth_sigma_rad=0.02)
    found = align(w, f, 30.0, site, imu)
    assert found.sigma[2] == found.filter_sigma[2] == 0.02
    assert abs(np.sin(0.5 * (azimuth_of(found.C_nb) - azimuth))) < 1e-9
    # Level does not move.
    np.testing.assert_allclose(found.C_nb[2], C_nb[2], rtol=0, atol=1e-12)


@pytest.mark.parametrize("heading", [-2.0, 0.0, 0.7, 3.0])
def test_azimuth_is_that_of_x_and_of_y_when_x_is_steep(heading):
    C_nb = rotation_matrix(np.array([0.0, 0.0, heading]))
    assert azimuth_of(C_nb) == pytest.approx(heading)
    # Pitched up about its own y axis, which stays level: x keeps its azimuth up to 45 deg, then y speaks.
    assert azimuth_of(C_nb @ rotation_matrix(np.array([0.0, 0.7, 0.0]))) == pytest.approx(heading)
    steep = azimuth_of(C_nb @ rotation_matrix(np.array([0.0, 0.9, 0.0])))
    assert np.sin(0.5 * (steep - heading - np.pi / 2)) == pytest.approx(0.0, abs=1e-12)


def test_no_specific_force_is_refused_in_one_line(imu):
    with pytest.raises(DataError, match="/imu/data_raw: no specific force"):
        align(np.array([0.0, 0.0, 7e-5]), np.array([0.0, 0.0, -0.5]), 30.0, Site(0.6), imu)
    with pytest.raises(DataError):
        align(np.zeros(3), np.full(3, np.nan), 30.0, Site(0.6), imu)
