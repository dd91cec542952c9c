"""Temperature profiles: the rate is the derivative, the sensors lag, the thermometer reads."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sdimu_sim.core.temperature import TemperatureProfile, Thermometer

CHAMBER = ((0.0, -40.0), (300.0, -40.0), (1800.0, 20.0), (2400.0, 20.0), (2700.0, 5.0))


def test_rate_is_the_derivative_of_the_temperature():
    profile = TemperatureProfile(20.0, 8.0, 1200.0, 0.5, 600.0)
    t = np.linspace(1.0, 3000.0, 50)
    slope = (profile.value(t + 0.1) - profile.value(t - 0.1)) / 0.2
    # Central differences: 0.1^2/6 of the third derivatives of ripple and warm-up, and rounding of 30 over 0.1.
    bound = 0.01 / 6 * (0.5 * (2 * np.pi / 600) ** 3 + 8.0 / 1200**3) + 1e-13
    np.testing.assert_allclose(profile.rate(t), slope, rtol=0, atol=bound)


def test_a_constant_profile_is_constant():
    assert np.ptp(TemperatureProfile(25.0).value(np.linspace(0, 1e4, 9))) == 0.0


def test_a_chamber_goes_straight_from_knot_to_knot_and_stays_at_the_last():
    profile = TemperatureProfile(-40.0, knots=CHAMBER)
    np.testing.assert_allclose(
        profile.value(np.array([0.0, 300.0, 1050.0, 2100.0, 2550.0, 9e9])),
        [-40.0, -40.0, -10.0, 20.0, 12.5, 5.0],
        rtol=1e-14,
    )
    np.testing.assert_allclose(profile.rate(np.array([10.0, 1000.0, 2500.0, 3000.0])), [0.0, 0.04, -0.05, 0.0])


@pytest.mark.parametrize("lag", [20.0, 400.0, 1200.0])
@pytest.mark.parametrize("knots", [(), CHAMBER])
def test_the_sensors_follow_the_thermometer_through_a_first_order_lag(knots, lag):
    """The closed form against a numerical integration of the differential equation; one lag is that of the warm-up."""
    profile = TemperatureProfile(-40.0, 8.0, 1200.0, 0.5, 600.0, knots=knots, sensor_lag_s=lag)
    t = np.linspace(0.0, 4000.0, 81)
    found = solve_ivp(
        lambda now, y: (profile.value(np.array([now])) - y) / lag,
        (0.0, 4000.0),
        [-40.0],
        t_eval=t,
        rtol=1e-9,
        atol=1e-9,
        max_step=5.0,
    )
    np.testing.assert_allclose(profile.sensor_value(t), found.y[0], rtol=0, atol=2e-5)
    slope = (profile.sensor_value(t[1:] + 0.1) - profile.sensor_value(t[1:] - 0.1)) / 0.2
    np.testing.assert_allclose(profile.sensor_rate(t[1:]), slope, rtol=0, atol=1e-4)


def test_without_a_lag_the_sensors_are_as_warm_as_the_thermometer():
    profile = TemperatureProfile(20.0, 8.0, knots=CHAMBER)
    t = np.linspace(0.0, 3000.0, 31)
    np.testing.assert_array_equal(profile.sensor_value(t), profile.value(t))
    np.testing.assert_array_equal(profile.sensor_rate(t), profile.rate(t))


def test_the_origin_is_the_temperature_at_the_start_unless_a_reference_is_stated():
    assert TemperatureProfile(-40.0, 8.0, knots=CHAMBER).origin_degc == -40.0
    assert TemperatureProfile(-40.0, knots=CHAMBER, reference_degc=25.0).origin_degc == 25.0


def test_a_thermometer_reads_the_same_digits_however_it_is_asked():
    profile = TemperatureProfile(20.0, 8.0, offset=0.3, noise=0.05, resolution=0.01)
    t = np.arange(1000.0)
    whole = Thermometer(profile, 3).read(t)
    other = Thermometer(profile, 3)
    parts = [other.read(t[a:b]) for a, b in ((0, 17), (17, 400), (400, 1000))]
    np.testing.assert_array_equal(whole, np.concatenate(parts))
    np.testing.assert_allclose(whole, 0.01 * np.round(whole / 0.01), rtol=0, atol=1e-12)
    error = whole - profile.value(t)
    # Five sigma of a mean and of a standard deviation of a thousand; rounding adds 0.003.
    assert abs(np.mean(error) - 0.3) < 5 * 0.05 / np.sqrt(1000)
    assert abs(np.std(error) - 0.05) < 5 * 0.05 / np.sqrt(2000) + 1e-4
    assert np.any(Thermometer(profile, 4).read(t) != whole)
