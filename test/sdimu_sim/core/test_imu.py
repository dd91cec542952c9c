"""Readings: signs of the thirty coefficients, white noise, saturation, pulses."""

import numpy as np
import pytest

from sdimu_calibration.core.units import STANDARD_GRAVITY
from sdimu_sim.core.generator import Electronics, response
from sdimu_sim.core.samples import TrueSamples
from sdimu_sim.core.truth import COEFFICIENTS, ImuTruth

W, F = np.array([0.31, -0.17, 0.23]), np.array([3.1, -5.7, -7.3])
A = F / STANDARD_GRAVITY
ONE = np.ones((3, 1))
TRUE = TrueSamples(W[:, None], F[:, None], 0 * ONE, 0 * ONE, 0 * ONE, F[:, None] / -9.8, np.zeros((3, 3, 1)))

# Derivative of the reading (sensor 0-2 gyro, 3-5 accelerometer) by each coefficient: the error equations of
# doc/conventions.md, term by term.
EQUATIONS = {
    **{f"gyro_bias_{i}": (k, 1.0) for k, i in enumerate("xyz")},
    **{f"gyro_scale_{i}": (k, W[k]) for k, i in enumerate("xyz")},
    "gyro_misalignment_xy": (0, -W[2]),
    "gyro_misalignment_xz": (0, W[1]),
    "gyro_misalignment_yx": (1, W[2]),
    "gyro_misalignment_yz": (1, -W[0]),
    "gyro_misalignment_zx": (2, -W[1]),
    "gyro_misalignment_zy": (2, W[0]),
    "gyro_mass_unbalance_dx": (0, A[0]),
    "gyro_mass_unbalance_qx": (0, A[1]),
    "gyro_mass_unbalance_dy": (1, A[1]),
    "gyro_mass_unbalance_qy": (1, A[0]),
    "gyro_mass_unbalance_dz": (2, A[2]),
    "gyro_mass_unbalance_qz": (2, A[1]),
    **{f"accel_bias_{i}": (3 + k, 1.0) for k, i in enumerate("xyz")},
    **{f"accel_scale_{i}": (3 + k, F[k]) for k, i in enumerate("xyz")},
    "accel_misalignment_xy": (3, -F[2]),
    "accel_misalignment_xz": (3, F[1]),
    "accel_misalignment_yx": (4, F[2]),
    "accel_misalignment_yz": (4, -F[0]),
    "accel_misalignment_zx": (5, -F[1]),
    "accel_misalignment_zy": (5, F[0]),
}


def test_the_table_of_this_test_has_every_coefficient():
    assert set(EQUATIONS) == set(COEFFICIENTS)


@pytest.mark.parametrize("name", COEFFICIENTS)
def test_each_coefficient_acts_as_in_the_error_equations_to_first_order(name):
    size = 1e-5
    up, down = (response(ImuTruth({name: s * size}), TRUE)[:, 0] for s in (1, -1))
    expected = np.zeros(6)
    sensor, slope = EQUATIONS[name]
    expected[sensor] = slope
    # Central differences leave the third order of the rotation (1e-10) and rounding (1e-16 * 10 / 1e-5).
    np.testing.assert_allclose((up - down) / (2 * size), expected, rtol=0, atol=1e-9)


def test_a_perfect_sensor_reads_the_truth():
    np.testing.assert_array_equal(response(ImuTruth(), TRUE)[:, 0], [*W, *F])


@pytest.mark.parametrize("interval", [0.01, 0.001])
def test_noise_density_is_the_sigma_of_a_mean_over_one_second(interval):
    truth = ImuTruth(gyro_white_noise=2e-6, accel_white_noise=3e-4)
    gyro, accel = Electronics(truth, interval, 4).apply(np.zeros((6, 100_000)))
    for values, density in ((gyro, 2e-6), (accel, 3e-4)):
        per_second = values.std() * np.sqrt(interval)
        # Five sigma of the standard deviation of 300,000 numbers.
        assert per_second == pytest.approx(density, rel=5 / np.sqrt(2 * values.size))
    assert abs(np.corrcoef(gyro[:, 0], accel[:, 0])[0, 1]) < 5 / np.sqrt(100_000)


def test_pulses_are_whole_and_lose_nothing_over_time():
    truth = ImuTruth(gyro_step_rad=1e-5, accel_step_m_s=1e-3)
    readings = np.outer([0.1, -0.2, 0.3, 1.0, 9.8, -5.0], np.ones(5000)) * 1.0001234
    gyro, accel = Electronics(truth, 0.01, 0).apply(readings)
    for values, true, step in ((gyro, readings[:3].T, 1e-5), (accel, readings[3:].T, 1e-3)):
        pulses = values * 0.01 / step
        np.testing.assert_allclose(pulses, np.round(pulses), atol=1e-6)
        drift = np.abs(np.cumsum(values - true, axis=0) * 0.01)
        assert drift.max() <= 0.5 * step * (1 + 1e-6)


def test_readings_saturate_at_the_limit():
    truth = ImuTruth(gyro_limit_rad_s=0.2, accel_limit_m_s2=5.0)
    gyro, accel = Electronics(truth, 0.01, 0).apply(np.outer([0.1, -0.3, 0.3, 1.0, 9.8, -9.8], np.ones(2)))
    np.testing.assert_array_equal(gyro[0], [0.1, -0.2, 0.2])
    np.testing.assert_array_equal(accel[0], [1.0, 5.0, -5.0])
