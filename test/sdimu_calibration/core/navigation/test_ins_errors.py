"""F11 and its integrals against the mechanization itself and against general matrix integrals."""

import numpy as np
import pytest
from scipy.linalg import expm

from sdimu_calibration.core import earth
from sdimu_calibration.core.navigation.ins_errors import navigation_error_matrix, process_noise, transition
from sdimu_calibration.core.navigation.strapdown import navigate_cycle
from sdimu_calibration.core.rotation import rotation_matrix, rotation_vector, skew

SPEED = np.sqrt(9.8 * 6.37e6)
SCALE = np.array([6.37e6] * 3 + [SPEED] * 3 + [1.0] * 3)
"""Natural units of the nine errors (m, m/s, rad): Schuler's dynamics become 1.24e-3 1/s in them everywhere."""

F_N = np.array([1.5, -2.0, -9.6])

PLACES = [(36.4, 80.0, (140.0, -90.0, 6.0)), (-60.0, 3000.0, (-60.0, 210.0, -3.0)), (5.0, 0.0, (0.0, 0.0, 0.0))]


def perturbed(C_nb, velocity, position, error):
    """State that a computer with this error has: computed minus true, C = (I - [e x]) C_true."""
    r_n, r_e = earth.radii(position[0])
    h = position[2]
    p = np.array(
        [
            position[0] + error[0] / (r_n + h),
            position[1] + error[1] / ((r_e + h) * np.cos(position[0])),
            position[2] - error[2],
        ]
    )
    return rotation_matrix(-error[6:]) @ C_nb, velocity + error[3:6], p


def difference(computed, true):
    """Error of a computed state against a true one, in metres, m/s and rad; the inverse of `perturbed`."""
    (C, v, p), (C0, v0, p0) = computed, true
    r_n, r_e = earth.radii(p0[0])
    dp = p - p0
    metres = [dp[0] * (r_n + p0[2]), dp[1] * (r_e + p0[2]) * np.cos(p0[0]), -dp[2]]
    return np.concatenate([metres, v - v0, -rotation_vector(C @ C0.T)])


def advance(state, phi, dv, dt, steps):
    C, v, p = (np.array(part) for part in state)
    for _ in range(steps):
        navigate_cycle(C, v, p, phi, dv, dt, earth.normal_gravity(p[0], p[2]))
    return C, v, p


def numerical_matrix(C_nb, velocity, position, omega, force, duration):
    """Response of the mechanization to each error after `duration`, central differences; (9, 9)."""
    steps = 4
    dt = duration / steps
    phi, dv = omega * dt, force * dt + 0.5 * np.cross(omega * dt, force * dt)
    out = np.empty((9, 9))
    size = np.array([2e3] * 3 + [1.0] * 3 + [1e-3] * 3)
    true = advance((C_nb, velocity, position), phi, dv, dt, steps)
    for j in range(9):
        ends = []
        for sign in (1.0, -1.0):
            error = np.zeros(9)
            error[j] = sign * size[j]
            ends.append(difference(advance(perturbed(C_nb, velocity, position, error), phi, dv, dt, steps), true))
        out[:, j] = (ends[0] - ends[1]) / (2 * size[j])
    return out


@pytest.mark.parametrize(("lat_deg", "height", "velocity"), PLACES)
def test_f11_is_the_derivative_of_the_mechanization(lat_deg, height, velocity, general_attitude):
    lat, v = np.radians(lat_deg), np.array(velocity)
    position = np.array([lat, 0.3, height])
    f_b = np.array([3.0, -5.0, 7.5])
    r_n, r_e = earth.radii(lat)
    turn_of_ned = [v[1] / (r_e + height), -v[0] / (r_n + height), -v[1] * np.tan(lat) / (r_e + height)]
    omega = general_attitude.T @ (earth.earth_rate(lat) + turn_of_ned)
    # d/dt at the start: (3 D(h) with halving) kills the first order of the step.
    derivative = []
    for h in (0.8, 0.4):
        Phi = numerical_matrix(general_attitude, v, position, omega, f_b, h)
        derivative.append((Phi - np.eye(9)) / h)
    numerical = 2.0 * derivative[1] - derivative[0]
    F = navigation_error_matrix(position, v, general_attitude @ f_b)
    natural = (numerical - F) * SCALE / SCALE[:, None]
    # Left out of F11: the change of the radii and of gravity with latitude, 3 flattenings of the transport rate and
    # 0.053 m/s^2 per radian of gravity; in the gradient of gravity, the centrifugal 2 w^2 and a flattening (Bruns).
    # The rest: second order of the step and rounding of latitudes.
    allowed = np.full((9, 9), 2e-8)
    transport = np.linalg.norm(v) / 6.37e6
    allowed[:, 0] += 3.0 * earth.FLATTENING * transport * max(1.0, np.tan(abs(lat)))
    allowed[1, 1] += 3.0 * earth.FLATTENING * transport * np.tan(abs(lat))
    allowed[5, 2] += (2.0 * earth.RATE**2 + 2.0 * 9.83 / 6.37e6 * earth.FLATTENING) * 6.37e6 / SPEED
    allowed[3:6, 0] += 3.0 * earth.FLATTENING * transport * np.linalg.norm(v) / SPEED
    allowed[5, 0] += 0.053 / SPEED
    assert (np.abs(natural) < allowed).all(), np.argwhere(np.abs(natural) >= allowed)


def test_every_group_of_f11_is_above_the_tolerance_of_its_test(general_attitude):
    """The test before this one must be able to fail: in natural units each kind of term is far above 2e-8 1/s."""
    position, v = np.array([np.radians(36.4), 0.3, 80.0]), np.array([140.0, -90.0, 6.0])
    F = navigation_error_matrix(position, v, general_attitude @ np.array([3.0, -5.0, 7.5]))
    natural = np.abs(F * SCALE / SCALE[:, None])
    for block in ((slice(0, 3), slice(0, 3)), (slice(3, 6), slice(0, 3)), (slice(6, 9), slice(0, 3))):
        assert natural[block][natural[block] > 0].min() > 1e-7 / 2


@pytest.mark.parametrize(("lat_deg", "height", "velocity"), PLACES)
def test_transition_is_the_exponential(lat_deg, height, velocity):
    F = navigation_error_matrix(np.array([np.radians(lat_deg), 0.3, height]), np.array(velocity), F_N)
    for dt in (0.1, 1.0):
        # In mixed units F has entries from 1e-13 to 10, and the Pade quotient inside expm loses what they differ by.
        exact = expm(F * dt * SCALE / SCALE[:, None])
        size = np.linalg.norm(F * SCALE / SCALE[:, None], 2) * dt
        # The fourth term of the series is the first left out; an entry is a sum of nine products of order one.
        allowed = size**4 / 24 + 9 * np.finfo(float).eps
        assert np.abs(transition(F, dt) * SCALE / SCALE[:, None] - exact).max() < allowed


def van_loan(F, W, dt):
    """Integral of exp(F s) W exp(F' s) over dt (Van Loan 1978)."""
    n = len(F)
    block = expm(np.block([[-F, W], [np.zeros((n, n)), F.T]]) * dt)
    return block[n:, n:].T @ block[:n, n:]


def anisotropic(seed, size):
    A = np.random.default_rng(seed).standard_normal((3, 3))
    return size * (A @ A.T + np.eye(3))


GYRO_PSD, ACCEL_PSD = anisotropic(1, (5e-7) ** 2), anisotropic(2, (1e-4) ** 2)


def spectral(C_qg, C_qa):
    W = np.zeros((9, 9))
    W[3:6, 3:6], W[6:, 6:] = C_qa, C_qg
    return W


def relative(A, B):
    """Largest difference in units of the standard deviations."""
    sigma = np.sqrt(np.diag(B))
    return np.abs((A - B) / np.outer(sigma, sigma)).max()


@pytest.mark.parametrize("dt", [0.1, 1.0])
def test_process_noise_is_the_integral_for_constant_force(dt):
    F = np.zeros((9, 9))
    F[0:3, 3:6] = np.eye(3)
    F[3:6, 6:9] = skew(F_N)
    exact = van_loan(F, spectral(GYRO_PSD, ACCEL_PSD), dt)
    assert relative(process_noise(GYRO_PSD, ACCEL_PSD, F_N, dt), exact) < 1e-10


@pytest.mark.parametrize("lat_deg", [36.4, -60.0])
def test_process_noise_leaves_out_only_the_turn_of_earth_and_transport(lat_deg):
    F = navigation_error_matrix(np.array([np.radians(lat_deg), 0.0, 0.0]), np.array([10.0, -5.0, 0.0]), F_N)
    exact = van_loan(F, spectral(GYRO_PSD, ACCEL_PSD), 1.0)
    # 1e-4 rad of turn in a second.
    assert relative(process_noise(GYRO_PSD, ACCEL_PSD, F_N, 1.0), exact) < 2e-4
