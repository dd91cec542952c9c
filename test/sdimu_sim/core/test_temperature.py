"""Temperature profiles: the rate is the derivative."""

import numpy as np

from sdimu_sim.core.temperature import TemperatureProfile


def test_rate_is_the_derivative_of_the_temperature():
    profile = TemperatureProfile(20.0, 8.0, 1200.0, 0.5, 600.0)
    t = np.linspace(1.0, 3000.0, 50)
    slope = (profile.value(t + 0.1) - profile.value(t - 0.1)) / 0.2
    # Central differences: 0.1^2/6 of the third derivatives of ripple and warm-up, and rounding of 30 over 0.1.
    bound = 0.01 / 6 * (0.5 * (2 * np.pi / 600) ** 3 + 8.0 / 1200**3) + 1e-13
    np.testing.assert_allclose(profile.rate(t), slope, rtol=0, atol=bound)


def test_a_constant_profile_is_constant():
    assert np.ptp(TemperatureProfile(25.0).value(np.linspace(0, 1e4, 9))) == 0.0
