"""The platform between its samples: exact where it must be, convergent where it can only be that."""

import numpy as np
import pytest

from rate_table_sim.core.gimbal import gimbal_axes, gimbal_motion
from rate_table_sim.core.specification import Imperfections
from sdimu_calibration.core import earth
from sdimu_calibration.core.rotation import quaternion_matrix, skew
from sdimu_sim.core.platform import mean_motion

EARTH = earth.earth_rate(0.6)
FIELD = np.array([3e-5, -4e-6, 4e-5])
AXES = gimbal_axes(("Y", "Z", "X"), Imperfections())
FRAME = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


def moved(t):
    """All three axes at once, smoothly, from a general attitude: q_nt (n, 4), omega_nt_t (n, 3)."""
    angle = np.column_stack([0.4 + 0.5 * t, 1.1 + 0.3 * np.sin(t), -0.8 + 0.2 * t - 0.1 * t**2])
    rate = np.column_stack([0.5 + 0 * t, 0.3 * np.cos(t), 0.2 - 0.2 * t])
    return gimbal_motion(angle, rate, AXES, np.zeros(3), 0.0, FRAME)


def means(t, q, w, edges):
    return mean_motion(t, q, w, np.asarray(edges, dtype=float), EARTH, FIELD)


def test_constant_angular_acceleration_about_a_fixed_axis_is_exact_between_coarse_samples():
    # Outer axis only, samples 1 s apart, 30 deg/s^2: the mean rate of an interval is the rate at its middle.
    t, a = np.arange(4.0), np.radians(30.0)
    zero = 0 * t
    q, w = gimbal_motion(
        np.column_stack([0.5 * a * t**2, zero + 0.7, zero - 0.4]),
        np.column_stack([a * t, zero, zero]),
        AXES,
        np.zeros(3),
        0.0,
        FRAME,
    )
    edges = np.linspace(0, 3, 14)
    out = means(t, q, w, edges)
    direction = w[1] / np.linalg.norm(w[1])
    middle = 0.5 * (edges[1:] + edges[:-1])
    np.testing.assert_allclose(out[6:9], np.outer(direction, a * middle), rtol=0, atol=1e-14)
    ends = np.array([means(t, q, w, [s, s + 1e-7])[6:9, 0] for s in (0.3, 2.2)])
    np.testing.assert_allclose(ends, np.outer(a * (np.array([0.3, 2.2]) + 5e-8), direction), rtol=0, atol=1e-9)


def test_general_motion_converges_at_fourth_order():
    # The cubic follows the rotation vector to h^4, and a mean over whole samples no worse.
    edges = np.linspace(0, 2, 5)
    fine = np.linspace(0, 2, 4001)
    exact = means(fine, *moved(fine), edges)
    errors = []
    for n in (10, 20, 40):
        t = np.linspace(0, 2, 2 * n + 1)
        errors.append(np.abs(means(t, *moved(t), edges)[:15] - exact[:15]).max())
    assert errors[0] / errors[1] > 2**3.5
    assert errors[1] / errors[2] > 2**3.5


def test_means_are_means_of_shorter_means():
    t = np.linspace(0, 2, 41)
    motion = moved(t)
    whole = means(t, *motion, [0.13, 1.7])[:, 0]
    parts = means(t, *motion, np.linspace(0.13, 1.7, 318)).mean(axis=1)
    # Three nodes on 0.05 s against a hundredth of that: the quadrature's own error, of sixth order.
    np.testing.assert_allclose(parts, whole, rtol=0, atol=1e-11)


def test_angular_acceleration_is_the_change_of_the_rate():
    t = np.linspace(0, 2, 41)
    q, w = moved(t)
    inertial = w + np.array([quaternion_matrix(p).T @ EARTH for p in q])
    out = means(t, q, w, t)
    np.testing.assert_allclose(out[9:12].T, np.diff(inertial, axis=0) / 0.05, rtol=0, atol=1e-9)


def test_lever_tensor_is_angular_acceleration_and_centripetal_term():
    t = np.linspace(0, 2, 2001)
    out = means(t, *moved(t), t)
    k = 700
    omega, alpha = skew(np.ascontiguousarray(out[0:3, k])), skew(np.ascontiguousarray(out[9:12, k]))
    # Over 1 ms the mean of a product is the product of means to (alpha dt)^2 / 12.
    np.testing.assert_allclose(out[15:24, k].reshape(3, 3), alpha + omega @ omega, rtol=0, atol=1e-6)


def test_at_rest_earth_rate_gravity_and_field_appear_in_the_platform_frame():
    q, w = moved(np.array([0.7]))
    t = np.array([0.0, 1.0, 2.0])
    out = means(t, np.repeat(q, 3, axis=0), 0 * np.repeat(w, 3, axis=0), [0.0, 0.01, 1.5])
    C_nt = quaternion_matrix(q[0])
    for k in (0, 1):
        np.testing.assert_allclose(out[0:3, k], C_nt.T @ EARTH, rtol=0, atol=1e-19)
        np.testing.assert_allclose(out[3:6, k], C_nt.T @ [0, 0, 1], rtol=0, atol=1e-15)
        np.testing.assert_allclose(out[12:15, k], C_nt.T @ FIELD, rtol=0, atol=1e-19)
        assert not out[6:12, k].any()


def test_before_the_first_sample_the_platform_rests():
    t = np.linspace(0, 2, 41)
    q, w = moved(t)
    out = means(t, q, w, [-0.02, -0.01, 0.01])
    np.testing.assert_allclose(out[0:3, 0], quaternion_matrix(q[0]).T @ EARTH, rtol=0, atol=1e-19)
    # Half of the second interval is at rest, half at the starting rate.
    np.testing.assert_allclose(out[6:9, 1], 0.5 * w[0], rtol=0, atol=0.01)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_sign_of_a_quaternion_does_not_matter(sign):
    t = np.linspace(0, 2, 41)
    q, w = moved(t)
    flipped = q * np.where(np.arange(41) % 2, sign, 1.0)[:, None]
    np.testing.assert_array_equal(means(t, flipped, w, t)[6:9], means(t, q, w, t)[6:9])
