"""The Earth against published numbers and against geometry."""

import numpy as np
import pytest
from scipy.integrate import quad

from sdimu_calibration.core import earth


def ecef(lat, lon, height):
    """Position in the Earth frame (m)."""
    n = earth.SEMI_MAJOR / np.sqrt(1 - earth.ECCENTRICITY_SQUARED * np.sin(lat) ** 2)
    cos = np.cos(lat)
    down_scale = 1 - earth.ECCENTRICITY_SQUARED
    return np.array(
        [(n + height) * cos * np.cos(lon), (n + height) * cos * np.sin(lon), (n * down_scale + height) * np.sin(lat)]
    )


def ned_axes(lat, lon):
    """C_en: columns are North, East, Down in the Earth frame."""
    s, c, sl, cl = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    return np.array([[-s * cl, -sl, -c * cl], [-s * sl, cl, -c * sl], [c, 0.0, -s]])


def test_gravity_at_equator_and_pole_is_that_of_wgs84():
    # NIMA TR8350.2, table 3.4, ten digits.
    assert earth.normal_gravity(0.0, 0.0) == pytest.approx(9.7803253359, abs=1e-9)
    for pole in (np.pi / 2, -np.pi / 2):
        assert earth.normal_gravity(pole, 0.0) == pytest.approx(9.8321849379, abs=1e-9)


def test_gravity_falls_by_the_free_air_gradient():
    # Published free-air gradient: 0.3086 mGal/m at 45 deg; 1 mGal = 1e-5 m/s^2; four digits are given.
    lat = np.radians(45.0)
    gradient = (earth.normal_gravity(lat, 50.0) - earth.normal_gravity(lat, -50.0)) / 100.0
    assert gradient == pytest.approx(-3.086e-6, abs=0.001e-6)


@pytest.mark.parametrize("lat_deg", [-60.0, 0.0, 36.0, 90.0])
def test_gradient_of_gravity_follows_from_curvature_by_bruns(lat_deg):
    # dg/dh = -g (1/M + 1/N) - 2 w^2 (Heiskanen & Moritz, eq. 2-20), exact; the series is first order in flattening and
    # its second order has coefficients of a few.
    lat = np.radians(lat_deg)
    meridian, vertical = earth.radii(lat)
    slope = (earth.normal_gravity(lat, 1.0) - earth.normal_gravity(lat, -1.0)) / 2.0
    bruns = -earth.normal_gravity(lat, 0.0) * (1 / meridian + 1 / vertical) - 2.0 * earth.RATE**2
    assert slope == pytest.approx(bruns, rel=10.0 * earth.FLATTENING**2)


def test_the_fall_of_gravity_slows_down_with_height_as_that_of_a_sphere():
    # g ~ 1/(a + h)^2: the second derivative is 6 g/a^2, but for the flattening.
    height, lat = 10e3, np.radians(45.0)
    at = [earth.normal_gravity(lat, h) for h in (-height, 0.0, height)]
    assert (at[0] - 2.0 * at[1] + at[2]) / height**2 == pytest.approx(6.0 * at[1] / earth.SEMI_MAJOR**2, rel=0.01)


def test_earth_turns_once_in_a_sidereal_day():
    assert np.degrees(earth.RATE) * 3600.0 == pytest.approx(15.041067, abs=1e-6)
    assert 2 * np.pi / earth.RATE == pytest.approx(86164.1, abs=0.1)


@pytest.mark.parametrize("lat_deg", [-60.0, 0.0, 36.0, 89.0])
def test_earth_rate_is_the_polar_axis_seen_in_ned(lat_deg):
    lat = np.radians(lat_deg)
    polar_axis = ned_axes(lat, 1.2).T @ np.array([0.0, 0.0, earth.RATE])
    np.testing.assert_allclose(earth.earth_rate(lat), polar_axis, rtol=0, atol=1e-19)


def test_quarter_of_the_meridian_has_its_published_length():
    # WGS-84: 10 001 965.729 m from equator to pole.
    length, _ = quad(lambda lat: earth.radii(lat)[0], 0.0, np.pi / 2, epsabs=1e-4)
    assert length == pytest.approx(10_001_965.729, abs=2e-3)


@pytest.mark.parametrize("lat_deg", [-60.0, 0.0, 36.0, 80.0])
def test_radii_are_the_geometry_of_a_path(lat_deg):
    """Walk a little way: the metres are right."""
    lat, lon, h = np.radians(lat_deg), 0.8, 1500.0
    velocity = np.array([130.0, -70.0, 4.0])
    r_n, r_e = earth.radii(lat)
    rate = np.array([velocity[0] / (r_n + h), velocity[1] / ((r_e + h) * np.cos(lat)), -velocity[2]])
    dt = 1.0
    a = np.array([lat, lon, h]) - 0.5 * dt * rate
    b = np.array([lat, lon, h]) + 0.5 * dt * rate
    walked = ned_axes(lat, lon).T @ (ecef(*b) - ecef(*a)) / dt
    np.testing.assert_allclose(walked, velocity, rtol=0, atol=1e-6)
