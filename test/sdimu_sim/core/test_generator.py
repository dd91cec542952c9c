"""The simulated IMU: block by block as at once, delays, lost data, independent draws."""

import itertools

import numpy as np
import pytest

from rate_table_sim.core import TableSpecification, table_motion
from sdimu_calibration.core import earth
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.rotation import rotation_matrix
from sdimu_calibration.core.specification import Site
from sdimu_sim.core import ImuGenerator, ImuTruth, PlatformMotion, TemperatureProfile, simulate_imu
from sdimu_sim.core.generator import gravity_of
from sdimu_sim.core.hidden import LOST_AFTER_S
from sdimu_sim.core.samples import SampleClock

SITE = Site(np.radians(36.4), 120.0)
MOUNT = (0.03, -0.05, 0.02)
PLAN = Plan("test", (4.0, 3.0, 3.0), (Turn("Y", np.radians(90), 0.2), Turn("Z", np.radians(-60), 0.15)), 0.3)
NOISY = ImuTruth(
    coefficients={"gyro_scale_x": 1e-3, "accel_misalignment_xy": 2e-3, "gyro_mass_unbalance_qx": 1e-6},
    mount_rad=MOUNT,
    gyro_white_noise=1e-6,
    accel_white_noise=1e-4,
    effects=(
        "accel_delay=3.7 ms",
        "gyro_delay_x=25 ms",
        "gyro_hysteresis_y=1 deg/h",
        "accel_hysteresis_x=20 ug",
        "gyro_lost_data=30 ms; turn=1",
        "gyro_bias_temperature_z=1 deg/h/degC",
        "accel_z=1e-4*sin(3*t)*tanh(ax)+1e-3*alphay",
    ),
    gyro_step_rad=1e-7,
    lever_arm_m=(0.1, -0.2, 0.05),
)
WARM = TemperatureProfile(rise=5.0, tau_s=10.0, ripple=0.1, ripple_period_s=3.0)


@pytest.fixture(scope="module")
def motion():
    table = table_motion(PLAN, TableSpecification())
    return PlatformMotion(table.t, table.q_nt, table.omega_nt_t)


def part(motion, a, b):
    return PlatformMotion(motion.t[a:b], motion.q_nt[a:b], motion.omega_nt_t[a:b])


def simulated(motion, truth, rate=100.0, seed=1, temperature=None):
    return simulate_imu(motion, truth, SITE, rate, seed, temperature)


@pytest.mark.parametrize("rate", [100.0, 30.0, 333.0])
@pytest.mark.parametrize("largest", [1, 7, 500])
def test_samples_are_the_same_to_the_last_bit_however_the_motion_is_cut(motion, rate, largest):
    whole = simulated(motion, NOISY, rate, 1, WARM)
    generator = ImuGenerator(NOISY, SITE, rate, 1, WARM)
    rng = np.random.default_rng(largest)
    cuts = np.unique(np.r_[0, np.cumsum(rng.integers(1, largest + 1, len(motion.t))), len(motion.t)])
    cuts = cuts[cuts <= len(motion.t)]
    parts = [generator.advance(part(motion, a, b)) for a, b in itertools.pairwise(cuts)]
    for name in ("ns", "t", "omega_ib_b", "f_ib_b"):
        np.testing.assert_array_equal(np.concatenate([getattr(p, name) for p in parts]), getattr(whole, name))


def test_every_interval_of_the_test_gives_one_sample(motion):
    for rate in (10.0, 100.0, 1000.0):
        assert len(simulated(motion, ImuTruth(), rate).t) == round(motion.t[-1] * rate)


def test_at_rest_a_perfect_imu_reads_gravity_and_earth_rate_in_its_own_frame(motion):
    samples = simulated(motion, ImuTruth(mount_rad=MOUNT))
    C_tb = rotation_matrix(np.array(MOUNT))
    up = np.array([0, 0, -earth.normal_gravity(SITE.latitude_rad, SITE.height_m)])
    np.testing.assert_allclose(samples.f_ib_b[0], C_tb.T @ up, rtol=0, atol=1e-14)
    np.testing.assert_allclose(samples.omega_ib_b[0], C_tb.T @ earth.earth_rate(SITE.latitude_rad), atol=1e-19)
    assert gravity_of(Site(0.6, 0.0, gravity_m_s2=9.81)) == 9.81


def test_the_rate_integrates_to_the_turn(motion):
    # About platform Y, 90 deg against NED; the Earth turns meanwhile by less than 1 mrad.
    samples = simulated(motion, ImuTruth())
    turning = (samples.t > 4.0) & (samples.t < 12.5)
    C = np.eye(3)
    for w in samples.omega_ib_b[turning]:
        C = C @ rotation_matrix(w * 0.01)
    expected = rotation_matrix(np.array([0.0, np.radians(90), 0.0]))
    np.testing.assert_allclose(C, expected, rtol=0, atol=earth.RATE * 10)


def test_a_new_effect_adds_itself_and_shifts_no_noise(motion):
    quiet = ImuTruth(mount_rad=MOUNT, gyro_white_noise=1e-6, accel_white_noise=1e-4)
    with_one = ImuTruth(
        mount_rad=MOUNT, gyro_white_noise=1e-6, accel_white_noise=1e-4, effects=("accel_bias_step_x=100 ug; t0=5 s",)
    )
    difference = simulated(motion, with_one).f_ib_b - simulated(motion, quiet).f_ib_b
    step = np.where(np.arange(len(difference)) >= 500, 100e-6 * 9.80665, 0.0)
    np.testing.assert_allclose(difference[:, 0], step, rtol=0, atol=1e-14)
    assert not difference[:, 1:].any()


def test_a_delay_of_one_sample_shifts_that_triad_by_one_sample(motion):
    now = simulated(motion, ImuTruth(mount_rad=MOUNT))
    late = simulated(motion, ImuTruth(mount_rad=MOUNT, effects=("accel_delay=10 ms",)))
    # Edges at k/100 - 0.01 and (k-1)/100 differ by rounding; times 2 g/s that is nothing.
    np.testing.assert_allclose(late.f_ib_b[1:], now.f_ib_b[:-1], rtol=0, atol=1e-13)
    np.testing.assert_array_equal(late.omega_ib_b, now.omega_ib_b)


def test_lost_data_take_their_angle_out_of_that_turn_only(motion):
    now = simulated(motion, ImuTruth(mount_rad=MOUNT))
    lost = simulated(motion, ImuTruth(mount_rad=MOUNT, effects=("gyro_lost_data=25 ms; turn=2",)))
    missing = (lost.omega_ib_b - now.omega_ib_b) * 0.01
    # Turn 2 starts after dwell, turn 1 (7.85 s) and dwell; 3 s later the rate is the constant one.
    start = 4.0 + round(np.radians(90) / 0.2 * 100) / 100 + 3.0 + LOST_AFTER_S
    at = np.flatnonzero(missing.any(axis=1))
    assert now.t[at[0]] > start
    assert now.t[at[-1]] < start + 0.025 + 0.01 + 1e-9
    rate = now.omega_ib_b[at[1]]
    np.testing.assert_allclose(missing.sum(axis=0), -0.025 * rate, rtol=0, atol=1e-7)


def test_hysteresis_has_the_sign_of_the_last_turn_and_keeps_it(motion):
    truth = ImuTruth(effects=("gyro_hysteresis_y=1 deg/h", "gyro_hysteresis_z=1 deg/h", "gyro_hysteresis_x=1 deg/h"))
    difference = simulated(motion, truth).omega_ib_b - simulated(motion, ImuTruth()).omega_ib_b
    size = np.radians(1 / 3600)
    np.testing.assert_allclose(difference[0], 0.0, atol=1e-15)
    np.testing.assert_allclose(difference[-1], [0.0, size, -size], rtol=0, atol=1e-15)


def test_a_lever_arm_feels_the_centripetal_acceleration(motion):
    arm = (0.0, 0.0, 0.3)
    with_arm = simulated(motion, ImuTruth(lever_arm_m=arm))
    difference = with_arm.f_ib_b - simulated(motion, ImuTruth()).f_ib_b
    plateau = np.flatnonzero((with_arm.t > 7.0) & (with_arm.t < 9.0))
    rate = with_arm.omega_ib_b[plateau[0], 1]
    # Turn about Y, arm along Z: towards the axis, -w^2 r. The Earth's share is w * 7e-5 * r.
    np.testing.assert_allclose(difference[plateau, 2], -(rate**2) * 0.3, rtol=0, atol=earth.RATE * 0.3)


def test_an_effect_of_temperature_needs_a_temperature(motion):
    with pytest.raises(DataError, match="temperature profile"):
        simulated(motion, ImuTruth(effects=("gyro_x=1e-6*T",)))


def test_a_formula_that_is_not_finite_is_refused(motion):
    with pytest.raises(DataError, match="not finite"):
        simulated(motion, ImuTruth(effects=("gyro_x=1/(t-t)",)))


def test_times_that_do_not_ascend_are_refused(motion):
    generator = ImuGenerator(ImuTruth(), SITE, 100.0, 1)
    generator.advance(part(motion, 0, 10))
    with pytest.raises(DataError, match="ascend"):
        generator.advance(part(motion, 5, 20))


@pytest.mark.parametrize("rate", [100.0, 300.0, 333.0, 1000.0, 62.5])
def test_stamps_are_exact_to_a_nanosecond_over_a_long_test(rate):
    clock = SampleClock(rate)
    first, last = 1, int(rate * 10_000)
    ns = clock.nanoseconds(first, last)
    for k in (1, 2, 7, last // 3, last):
        exact = k * 10**9 / rate
        assert abs(int(ns[k - 1]) - exact) <= 0.5 + 1e-3
    np.testing.assert_allclose(clock.seconds(first, last), ns / 1e9, rtol=0, atol=0.6e-9)
