"""From samples to cycles: orders of convergence, exactness for a constant turn, and no trace of how blocks were cut."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from sdimu_calibration.core.navigation.strapdown import CYCLE_ANGLE, CYCLE_S, Cycles, Reducer, velocity_increment
from sdimu_calibration.core.rotation import rotation_matrix, rotation_vector, skew

AXES = rotation_matrix(np.array([-0.4, 2.1, 0.8]))
"""Body axes turned away from those in which a classical motion is simple."""


def reduced(t, omega, force):
    return Reducer(float(t[0])).add(t, omega, force)


def dead_reckoned(C_nb, cycles):
    """Attitude and velocity in inertial space from cycles: no Earth, no gravity."""
    C, v = C_nb.copy(), np.zeros(3)
    for k in range(len(cycles)):
        v += C @ velocity_increment(cycles.alpha[k], cycles.upsilon[k], cycles.sculling[k])
        C = C @ rotation_matrix(cycles.alpha[k] + cycles.coning[k])
    return C, v


def means(integral, edges):
    """Sample means of a vector function with a known integral, (n, 3)."""
    return np.diff(integral(edges), axis=1).T / np.diff(edges)[:, None]


CONE, SPIN = 0.001, 2 * np.pi * 5.0
"""Half-angle (rad) and rate (rad/s) of the classical coning motion."""


def coning_attitude(t):
    """The x-y rotation vector of size CONE that goes round at SPIN (Savage 1998; Bortz 1971)."""
    return rotation_matrix(CONE * np.array([np.cos(SPIN * t), np.sin(SPIN * t), 0.0]))


def coning_angle(t):
    """Integral of its body rate: (-W sin c sin Wt, W sin c cos Wt, -W (1 - cos c))."""
    return np.array([np.sin(CONE) * np.cos(SPIN * t), np.sin(CONE) * np.sin(SPIN * t), -SPIN * (1 - np.cos(CONE)) * t])


def coning_drift(rate_hz, C_nb, seconds=4.0):
    edges = np.arange(round(seconds * rate_hz) + 1) / rate_hz
    omega = means(coning_angle, edges) @ AXES.T
    cycles = reduced(edges[1:], omega, np.zeros_like(omega))
    start = C_nb @ coning_attitude(0.0) @ AXES.T
    C, _ = dead_reckoned(start, cycles)
    end = C_nb @ coning_attitude(cycles.t[-1]) @ AXES.T
    return float(np.linalg.norm(rotation_vector(C @ end.T))) / seconds, cycles


def test_the_coning_motion_of_these_tests_is_one():
    """Its rate is that of its attitude, by numerical differentiation."""
    h, t = 1e-5, 0.123
    turn = rotation_vector(coning_attitude(t - h).T @ coning_attitude(t + h)) / (2 * h)
    rate = (coning_angle(t + h) - coning_angle(t - h)) / (2 * h)
    np.testing.assert_allclose(turn, rate, rtol=0, atol=1e-7)


def test_coning_drift_is_fourth_order(general_attitude):
    drifts = [coning_drift(rate, general_attitude)[0] for rate in (50.0, 100.0, 200.0)]
    ratios = np.array(drifts[:-1]) / drifts[1:]
    # 2^4 = 16; one order less would give 8.
    assert (ratios > 12.0).all(), drifts
    assert (ratios < 24.0).all(), drifts


def test_coning_correction_takes_all_but_a_thousandth_of_the_drift(general_attitude):
    # Uncorrected: W c^2 / 2 about the cone's axis, less what a cycle of 0.1 s resolves.
    drift, cycles = coning_drift(200.0, general_attitude)
    assert drift < 1e-3 * SPIN * CONE**2 / 2
    plain = Cycles(**{**vars(cycles), "coning": np.zeros_like(cycles.coning)})
    C, _ = dead_reckoned(general_attitude @ coning_attitude(0.0) @ AXES.T, plain)
    end = general_attitude @ coning_attitude(cycles.t[-1]) @ AXES.T
    assert np.linalg.norm(rotation_vector(C @ end.T)) / 4.0 > 0.3 * SPIN * CONE**2 / 2


ROCK, PUSH = 0.001, 2.0
"""Amplitudes of the classical sculling motion: angle about x (rad), specific force along y (m/s^2), in phase."""


def sculling_error(rate_hz, C_nb, seconds=4.0):
    edges = np.arange(round(seconds * rate_hz) + 1) / rate_hz
    zero = np.zeros_like(edges)
    omega = means(lambda t: np.array([ROCK * np.sin(SPIN * t), zero, zero]), edges) @ AXES.T
    force = means(lambda t: np.array([zero, -PUSH / SPIN * np.cos(SPIN * t), zero]), edges) @ AXES.T
    cycles = reduced(edges[1:], omega, force)
    _, v = dead_reckoned(C_nb @ AXES.T, cycles)
    end = cycles.t[-1]
    # v = integral of C f: y gets cos(angle), z gets sin(angle) of the force; whole periods, so one period will do.
    period = 2 * np.pi / SPIN
    count = round(end / period)
    assert count * period == pytest.approx(end, abs=1e-12)

    def over_period(function):
        return (
            count
            * quad(lambda t: PUSH * np.sin(SPIN * t) * function(ROCK * np.sin(SPIN * t)), 0.0, period, epsabs=1e-13)[0]
        )

    exact = C_nb @ np.array([0.0, over_period(np.cos), over_period(np.sin)])
    return float(np.linalg.norm(v - exact)) / seconds


def test_sculling_drift_is_fourth_order(general_attitude):
    errors = [sculling_error(rate, general_attitude) for rate in (50.0, 100.0, 200.0)]
    ratios = np.array(errors[:-1]) / errors[1:]
    assert (ratios > 12.0).all(), errors
    assert (ratios < 24.0).all(), errors
    # Uncorrected: half the product of the amplitudes.
    assert errors[-1] < 1e-3 * ROCK * PUSH / 2


@pytest.mark.parametrize("angle", [1e-6, 1e-3, CYCLE_ANGLE])
def test_velocity_increment_of_a_constant_turn_across_the_force_is_exact(angle):
    """Constant rate and force in the body: the integral of Rodrigues' formula (Savage 1998, eq. 56)."""
    axis, force = AXES @ np.array([0.6, 0.0, 0.8]), AXES @ np.array([0.0, -9.8, 0.0])
    K = skew(axis)
    integral = np.eye(3) + (1 - np.cos(angle)) / angle * K + (1 - np.sin(angle) / angle) * K @ K
    dv = velocity_increment(angle * axis, 0.1 * force, np.zeros(3))
    np.testing.assert_allclose(dv, 0.1 * integral @ force, rtol=0, atol=1e-9 * 0.98)


@pytest.mark.parametrize("rate_deg", [2.0, 20.0, 90.0])
def test_gravity_keeps_its_size_and_direction_while_a_table_turns_it_through_the_body(rate_deg, general_attitude):
    """Half a turn about a level axis: the sum of C f dt is f_n T, whatever the rate."""
    w, rate_hz = np.radians(rate_deg), 100.0
    edges = np.arange(round(180.0 / rate_deg * rate_hz) + 1) / rate_hz
    zero = np.zeros_like(edges)
    omega = np.tile(AXES @ [w, 0.0, 0.0], (len(edges) - 1, 1))
    # f_b = -g (0, sin wt, cos wt)
    force = means(lambda t: 9.8 * np.array([zero, np.cos(w * t) / w, -np.sin(w * t) / w]), edges) @ AXES.T
    cycles = reduced(edges[1:], omega, force)
    _, v = dead_reckoned(general_attitude @ AXES.T, cycles)
    exact = general_attitude @ np.array([0.0, 0.0, -9.8]) * cycles.t[-1]
    # Exact to second order in a cycle of angle a; the third leaves a^4 / 30. A force taken as constant in the body
    # would leave a^3 / 24, seventy times more at 20 deg/s. Sculling is exact for a ramp between samples; the
    # curvature of a turn leaves (w dt)^3 / 2. The first sample of all has no neighbour: (w dt)^2 / 12 of one sample.
    angle, step = np.linalg.norm(cycles.alpha, axis=1).max(), w / rate_hz
    allowed = 1e-12 + angle**4 / 30 + step**3 / 2 + step**2 / 12 / len(omega)
    assert np.linalg.norm(v - exact) < allowed * np.linalg.norm(exact)


def test_cycles_end_on_tenths_of_a_second_and_close_early_in_fast_motion():
    t = np.arange(1, 1001) / 100.0
    omega = np.zeros((1000, 3))
    omega[500:] = AXES @ [0.0, 0.0, np.radians(200.0)]
    cycles = reduced(t, omega, np.zeros((1000, 3)))
    slow, fast = cycles.t <= 5.0 + 1e-9, cycles.t > 5.0 + 1e-9
    np.testing.assert_allclose(cycles.dt[slow], CYCLE_S, rtol=0, atol=1e-9)
    np.testing.assert_allclose(cycles.t[slow] / CYCLE_S, np.round(cycles.t[slow] / CYCLE_S), rtol=0, atol=1e-9)
    angle = np.linalg.norm(cycles.alpha, axis=1)
    one_sample = np.radians(200.0) / 100.0
    assert angle.max() < CYCLE_ANGLE + one_sample
    assert cycles.dt[fast].max() < CYCLE_S / 2
    np.testing.assert_allclose(cycles.alpha.sum(axis=0), omega.sum(axis=0) / 100.0, rtol=1e-12)


@given(
    st.lists(st.integers(0, 40), min_size=1, max_size=30), st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.1, 3.0])
)
def test_cycles_do_not_depend_on_how_samples_were_cut(lengths, seed, rate):
    rng = np.random.default_rng(seed)
    n = max(sum(lengths), 1)
    t = np.cumsum(0.01 * (1.0 + 0.05 * rng.uniform(-1, 1, n) + (rng.random(n) < 0.03) * rng.integers(1, 5, n)))
    omega, force = rate * rng.standard_normal((n, 3)), rng.standard_normal((n, 3)) - 9.8
    whole = Reducer(0.01).add(t, omega, force)
    reducer, parts, at = Reducer(0.01), [], 0
    for length in [*lengths, n]:
        rows = slice(at, min(at + length, n))
        parts.append(reducer.add(t[rows], omega[rows], force[rows]))
        at = rows.stop
    joined = Cycles.concatenate(parts)
    for name in Cycles.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(joined, name), getattr(whole, name), err_msg=name)


def test_lost_samples_are_counted_bridged_and_owned_up_to(general_attitude):
    """A gap in a steady turn loses nothing of it but the certainty."""
    t = np.arange(1, 301) / 100.0
    w = AXES @ [0.1, -0.2, 0.05]
    omega, force = np.tile(w, (300, 1)), np.tile([0.1, 0.2, -9.8], (300, 1))
    kept = (t < 1.234) | (t > 1.345)
    cycles = Reducer(0.01).add(t[kept], omega[kept], force[kept])
    missing = int((~kept).sum())
    assert cycles.lost.sum() == missing == 11
    assert cycles.samples.sum() == 300 - missing
    np.testing.assert_allclose(cycles.gap_angle.sum(axis=0), w * missing * 0.01, rtol=1e-9)
    C, v = dead_reckoned(general_attitude, cycles)
    full_C, full_v = dead_reckoned(general_attitude, Reducer(0.01).add(t, omega, force))
    np.testing.assert_allclose(C, full_C, rtol=0, atol=1e-12)
    np.testing.assert_allclose(v, full_v, rtol=1e-9)


def test_a_gap_in_a_ramp_takes_the_mean_of_its_neighbours():
    """Rate grows linearly: the trapezoid over the gap is exact but for the half samples at its ends."""
    edges = np.arange(301) / 100.0
    t = edges[1:]
    slope = np.array([0.05, -0.1, 0.2])
    omega = 0.5 * (edges[1:] + edges[:-1])[:, None] * slope
    kept = (t < 1.234) | (t > 1.345)
    total = Reducer(0.01).add(t[kept], omega[kept], np.zeros((int(kept.sum()), 3))).alpha.sum(axis=0)
    np.testing.assert_allclose(total, 0.5 * slope * 9.0, rtol=1e-9)
