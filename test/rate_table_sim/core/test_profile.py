"""Trapezoids: the mean rate is kept exactly, the acceleration limit is kept, breakpoints are samples."""

import math

import numpy as np
import pytest

from rate_table_sim.core.profile import trapezoid
from sdimu_calibration.core.plan import Turn
from sdimu_calibration.core.recording import DataError

DEG = math.pi / 180.0
TURNS = [(90.0, 2.0, 1.0, 100.0), (-180.0, 2.0, 1.0, 100.0), (45.0, 10.0, 20.0, 50.0), (7.3, 0.37, 0.11, 20.0)]


@pytest.mark.parametrize(("angle", "rate", "limit", "grid"), TURNS)
def test_length_is_angle_over_mean_rate_to_half_a_sample(angle, rate, limit, grid):
    profile = trapezoid(Turn("X", angle * DEG, rate * DEG), limit * DEG, grid, 1)
    assert abs(profile.samples / grid - abs(angle) / rate) <= 0.5 / grid + 1e-12


@pytest.mark.parametrize(("angle", "rate", "limit", "grid"), TURNS)
def test_acceleration_keeps_the_limit_and_a_shorter_ramp_would_not(angle, rate, limit, grid):
    profile = trapezoid(Turn("X", angle * DEG, rate * DEG), limit * DEG, grid, 1)
    assert profile.acceleration <= limit * DEG * (1 + 1e-9)
    n, ramp = profile.samples, profile.ramp_samples - 1
    assert ramp == 0 or abs(angle) * DEG / ((n - ramp) * ramp) * grid**2 > limit * DEG * (1 - 1e-9)


@pytest.mark.parametrize(("angle", "rate", "limit", "grid"), TURNS)
def test_rate_integrates_to_the_angle(angle, rate, limit, grid):
    # The rate is linear between samples, so the trapezoidal rule is exact up to rounding.
    profile = trapezoid(Turn("X", angle * DEG, rate * DEG), limit * DEG, grid, 1)
    turned, speed = profile.angle_and_rate()
    steps = 0.5 * (speed[1:] + speed[:-1]) / grid
    np.testing.assert_allclose(np.cumsum(steps), turned[1:], rtol=0, atol=1e-15 * profile.samples)
    assert turned[0] == 0.0
    assert turned[-1] == angle * DEG
    assert speed[0] == speed[-1] == 0.0


def test_a_turn_that_exceeds_the_limit_is_named():
    with pytest.raises(DataError, match=r"turn 7: .*deg/s\^2"):
        trapezoid(Turn("Z", 90 * DEG, 10 * DEG), 1 * DEG, 100.0, 7)
