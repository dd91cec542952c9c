"""Gimbal geometry: where the axes point, and how the platform turns with them."""

from __future__ import annotations

import numpy as np

from rate_table_sim.core.specification import Imperfections
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.rotation import cross, rotation_matrix
from sdimu_calibration.core.table.gimbals import unit


def gimbal_axes(axes: tuple[str, str, str], errors: Imperfections) -> Floats:
    """Directions of outer, middle and inner axis at zero angles, shape (3, 3), a row each, in the base."""
    outer, middle, inner = (unit(a) for a in axes)
    lean_middle = rotation_matrix(-errors.outer_middle_nonorthogonality_rad * cross(outer, middle))
    lean_inner = rotation_matrix(-errors.middle_inner_nonorthogonality_rad * cross(middle, inner))
    return np.array([outer, lean_middle @ middle, lean_inner @ inner])


@compiled
def turn_quaternion(phi: Floats) -> Floats:
    """Quaternion, shape (4,), scalar first, of a rotation vector (rad) of any length."""
    a = np.sqrt(np.dot(phi, phi))
    q = np.empty(4)
    q[0] = np.cos(0.5 * a)
    q[1:] = phi * (np.sin(0.5 * a) / a if a > 0.0 else 0.5)
    return q


@compiled
def quaternion_product(p: Floats, q: Floats) -> Floats:
    """Product p q, shape (4,): the rotation of p, then that of q about the turned axes."""
    r = np.empty(4)
    r[0] = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3]
    r[1] = p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2]
    r[2] = p[0] * q[2] + p[2] * q[0] + p[3] * q[1] - p[1] * q[3]
    r[3] = p[0] * q[3] + p[3] * q[0] + p[1] * q[2] - p[2] * q[1]
    return r


@compiled
def gimbal_motion(
    angle: Floats, rate: Floats, axis: Floats, base_tilt: Floats, wobble: float, wobble_frame: Floats
) -> tuple[Floats, Floats]:
    """Orientation of the platform against NED and its rate, exactly.

    ``C_nt = B R(outer) R(middle) W(inner) R(inner)``: B the base tilt, R(.) turns about the given axes, W the
    wobble ``rotation_matrix(w (cos i p - sin i q))`` with p, q across the inner axis.

    Parameters
    ----------
    angle, rate : ndarray, shape (n, 3)
        Outer, middle, inner axis (rad, rad/s).
    axis : ndarray, shape (3, 3)
        Directions of the axes at zero angles, a row each.
    base_tilt : ndarray, shape (3,)
        Rotation vector of the base in NED (rad).
    wobble : float
        Half angle of the inner axis' cone (rad).
    wobble_frame : ndarray, shape (2, 3)
        p and q: unit vectors, right-handed with the inner axis.

    Returns
    -------
    q_nt : ndarray, shape (n, 4)
        Scalar first, continuous in sign.
    omega_nt_t : ndarray, shape (n, 3)
        rad/s.
    """
    n = angle.shape[0]
    q_nt, omega = np.empty((n, 4)), np.empty((n, 3))
    # Products of half-angle quaternions: a quaternion taken from a matrix loses digits near half a turn.
    q_base = turn_quaternion(base_tilt)
    p, q = wobble_frame[0], wobble_frame[1]
    for k in range(n):
        C_middle = rotation_matrix(angle[k, 1] * axis[1])
        C_inner = rotation_matrix(angle[k, 2] * axis[2])
        c, s = np.cos(angle[k, 2]), np.sin(angle[k, 2])
        phi = wobble * (c * p - s * q)
        phi_rate = -wobble * rate[k, 2] * (s * p + c * q)
        W = rotation_matrix(phi)
        to_middle = rate[k, 1] * axis[1] + C_middle.T @ (rate[k, 0] * axis[0])
        of_wobble = _rate_of_rotation_vector(phi, phi_rate)
        omega[k] = rate[k, 2] * axis[2] + C_inner.T @ (of_wobble + W.T @ to_middle)
        q_outer = quaternion_product(q_base, turn_quaternion(angle[k, 0] * axis[0]))
        q_middle = quaternion_product(q_outer, turn_quaternion(angle[k, 1] * axis[1]))
        q_inner = quaternion_product(turn_quaternion(phi), turn_quaternion(angle[k, 2] * axis[2]))
        q_nt[k] = quaternion_product(q_middle, q_inner)
        if k and np.dot(q_nt[k], q_nt[k - 1]) < 0.0:
            q_nt[k] = -q_nt[k]
    return q_nt, omega


@compiled
def _rate_of_rotation_vector(phi: Floats, phi_rate: Floats) -> Floats:
    """Body rate of ``rotation_matrix(phi(t))``: (I - c1 [phi x] + c2 [phi x]^2) phi_rate, exact (Bortz 1971)."""
    a2 = np.dot(phi, phi)
    if a2 < 1e-6:
        c1, c2 = 0.5 - a2 / 24.0, 1.0 / 6.0 - a2 / 120.0
    else:
        a = np.sqrt(a2)
        c1, c2 = (1.0 - np.cos(a)) / a2, (a - np.sin(a)) / (a2 * a)
    once = cross(phi, phi_rate)
    rate: Floats = phi_rate - c1 * once + c2 * cross(phi, once)
    return rate
