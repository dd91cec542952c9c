"""Gimbal geometry: where the axes point, and which of them makes a turn about a platform axis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rate_table_sim.core.specification import AXES, Imperfections
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.rotation import cross, rotation_matrix

Floats = NDArray[np.float64]

_PARALLEL = 1e-9
"""Largest angle (rad) between a gimbal axis and the platform axis it is taken to turn about."""


def unit(letter: str) -> Floats:
    """Return the unit vector, shape (3,), of an axis letter."""
    vector = np.zeros(3)
    vector[AXES.index(letter)] = 1.0
    return vector


def gimbal_axes(axes: tuple[str, str, str], errors: Imperfections) -> Floats:
    """Directions of outer, middle and inner axis at zero angles, shape (3, 3), a row each, in the base."""
    outer, middle, inner = (unit(a) for a in axes)
    lean_middle = rotation_matrix(-errors.outer_middle_nonorthogonality_rad * cross(outer, middle))
    lean_inner = rotation_matrix(-errors.middle_inner_nonorthogonality_rad * cross(middle, inner))
    return np.array([outer, lean_middle @ middle, lean_inner @ inner])


def assign_turns(plan: Plan, axes: tuple[str, str, str]) -> tuple[tuple[int, float], ...]:
    """Which gimbal axis makes each turn, and in which sense.

    A turn about a platform axis is a turn of one gimbal axis only while that axis is parallel or antiparallel
    to it. Where two are, the choice decides what is possible later, so the choices are searched.

    Parameters
    ----------
    plan : Plan
    axes : tuple of str
        Axis letters of outer, middle and inner axis at zero angles.

    Returns
    -------
    tuple of (int, float)
        Gimbal axis (0 outer, 1 middle, 2 inner) and sign, one per turn.

    Raises
    ------
    DataError
        When no choice allows a turn; it names the furthest one that could be reached.
    """
    dead_ends: set[tuple[int, tuple[float, ...]]] = set()
    furthest = 0
    choice: list[tuple[int, float]] = []
    angles = [np.zeros(3)]
    untried = [_parallel_axes(plan, 0, angles[0], axes)]
    while len(choice) < len(plan.turns):
        number = len(choice)
        furthest = max(furthest, number)
        if not untried[-1]:
            dead_ends.add((number, _state(angles[-1])))
            if not choice:
                turn = plan.turns[furthest]
                raise DataError(
                    f"turn {furthest + 1} of plan {plan.name}: no gimbal axis is along {turn.axis} there "
                    f"(the table turns {', '.join(axes)}; use --table free, or axes: free in the table's file)"
                )
            untried.pop()
            angles.pop()
            choice.pop()
            continue
        k, sign = untried[-1].pop()
        after = angles[-1].copy()
        after[k] += sign * plan.turns[number].angle_rad
        if (number + 1, _state(after)) in dead_ends:
            continue
        choice.append((k, sign))
        angles.append(after)
        untried.append(_parallel_axes(plan, number + 1, after, axes))
    return tuple(choice)


def _state(angles: Floats) -> tuple[float, ...]:
    # Angles a full turn apart give the same directions.
    return tuple(np.round(np.concatenate([np.cos(angles), np.sin(angles)]), 6) + 0.0)


def _parallel_axes(plan: Plan, number: int, angles: Floats, axes: tuple[str, str, str]) -> list[tuple[int, float]]:
    """Gimbal axes along the platform axis of turn `number`, with sense; the innermost is last, to be tried first."""
    if number >= len(plan.turns):
        return []
    wanted = unit(plan.turns[number].axis)
    outer, middle, inner = (unit(a) for a in axes)
    C_inner = rotation_matrix(angles[2] * inner)
    C_middle = rotation_matrix(angles[1] * middle)
    along = (C_inner.T @ (C_middle.T @ outer), C_inner.T @ middle, inner)
    return [
        (k, float(np.sign(axis @ wanted)))
        for k, axis in enumerate(along)
        if np.linalg.norm(np.cross(axis, wanted)) < _PARALLEL
    ]


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
