"""Rotations: round trips for any rotation, and the group's own laws."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from sdimu_calibration.core.rotation import (
    cross,
    orthonormal,
    quaternion,
    quaternion_matrix,
    rotation_matrix,
    rotation_vector,
    skew,
)

vectors = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array)
directions = vectors.filter(lambda v: np.linalg.norm(v) > 1e-3).map(lambda v: v / np.linalg.norm(v))
angles = st.one_of(
    st.floats(0.0, np.pi),
    st.floats(0.0, 1e-3),
    st.floats(0.0, 1e-3).map(lambda small: np.pi - small),
    st.sampled_from([0.0, 1e-12, 1e-8, 1e-4, np.pi / 2, np.pi - 1e-7, np.pi]),
)


@given(vectors, vectors)
def test_skew_is_the_cross_product(a, b):
    np.testing.assert_allclose(skew(a) @ b, np.cross(a, b), rtol=0, atol=1e-14)
    np.testing.assert_allclose(cross(a, b), np.cross(a, b), rtol=0, atol=1e-14)


@given(directions, st.floats(0.0, 20.0))
def test_rotation_matrix_is_the_exponential_of_the_cross_product(axis, angle):
    # Scaling and squaring of the matrix exponential loses about three digits at 20 rad.
    C = rotation_matrix(angle * axis)
    np.testing.assert_allclose(C, expm(skew(angle * axis)), rtol=0, atol=1e-12)
    np.testing.assert_allclose(C @ C.T, np.eye(3), rtol=0, atol=4e-15)
    assert abs(np.linalg.det(C) - 1.0) < 1e-14


@settings(max_examples=300)
@given(directions, angles)
def test_rotation_vector_comes_back(axis, angle):
    C = rotation_matrix(angle * axis)
    back = rotation_vector(C)
    assert np.linalg.norm(back) <= np.pi + 1e-12
    # Same rotation: at half a turn either sign of the axis is right. Where the sine vanishes, the axis is known from
    # the cosine part only, to the sine's size (1e-7).
    np.testing.assert_allclose(rotation_matrix(back), C, rtol=0, atol=2e-7 if np.pi - angle < 1e-6 else 1e-9)
    if angle < 3.0:
        np.testing.assert_allclose(back, angle * axis, rtol=0, atol=1e-14 * (1.0 + 1.0 / (np.pi - angle)))


@given(directions, angles)
def test_quaternion_comes_back(axis, angle):
    C = rotation_matrix(angle * axis)
    q = quaternion(C)
    assert abs(np.linalg.norm(q) - 1.0) < 1e-14
    assert q[0] >= -1e-15
    np.testing.assert_allclose(quaternion_matrix(q), C, rtol=0, atol=2e-7 if np.pi - angle < 1e-6 else 1e-9)
    np.testing.assert_allclose(quaternion_matrix(-3.0 * q), quaternion_matrix(q), rtol=0, atol=1e-14)


@given(directions, angles)
def test_a_quarter_turn_about_z_takes_x_to_y_seen_through_any_rotation(axis, angle):
    """Active sense: ``rotation_matrix(phi)`` turns vectors by +phi; similarity turns the axis."""
    quarter = rotation_matrix(np.array([0.0, 0.0, np.pi / 2]))
    np.testing.assert_allclose(quarter @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], rtol=0, atol=1e-14)
    C = rotation_matrix(angle * axis)
    turned = rotation_matrix(C @ np.array([0.0, 0.0, np.pi / 2]))
    np.testing.assert_allclose(C @ quarter @ C.T, turned, rtol=0, atol=1e-14)


@given(directions, st.floats(0.0, np.pi), st.floats(1e-6, 1e-3))
def test_orthonormal_converges_quadratically(axis, angle, bend):
    """One Newton step leaves 3/8 of the squared departure from orthogonality."""
    C = rotation_matrix(angle * axis)
    D = np.array([[1.0, -0.3, 0.2], [0.4, -0.8, 0.1], [-0.2, 0.5, 0.6]])
    bent = C @ (np.eye(3) + bend * D)
    before = np.linalg.norm(bent @ bent.T - np.eye(3))
    after = orthonormal(bent)
    assert np.linalg.norm(after @ after.T - np.eye(3)) < before**2 + 1e-14
