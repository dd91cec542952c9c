"""The platform's motion as samples, and its exact continuation between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.compiled import compiled

Vector = tuple[float, float, float]

QUANTITIES = 24
"""Rows of `mean_motion`: omega_ib 0-2, down 3-5, omega_nb 6-8, alpha_ib 9-11, magnetic field 12-14, lever 15-23."""


@dataclass(frozen=True)
class PlatformMotion:
    """Orientation and rate of the platform t against NED at ascending times."""

    t: Floats
    """Seconds, shape (n,)."""
    q_nt: Floats
    """Scalar first, shape (n, 4)."""
    omega_nt_t: Floats
    """rad/s, resolved in t, shape (n, 3)."""


@compiled
def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def _sum3(a: float, x: Vector, b: float, y: Vector, c: float, z: Vector) -> Vector:
    return (a * x[0] + b * y[0] + c * z[0], a * x[1] + b * y[1] + c * z[1], a * x[2] + b * y[2] + c * z[2])


@compiled
def _sine_terms(a2: float) -> tuple[float, float, float, float, float]:
    """Return sin(a)/a, c1 = (1-cos a)/a^2, c2 = (a-sin a)/a^3 and the derivatives of c1, c2 by a^2."""
    if a2 < 1e-3:
        # Truncated at a^8: below 1e-17 here, where the closed forms lose digits.
        s = 1.0 - a2 / 6.0 * (1.0 - a2 / 20.0 * (1.0 - a2 / 42.0))
        c1 = 0.5 - a2 / 24.0 * (1.0 - a2 / 30.0 * (1.0 - a2 / 56.0))
        c2 = 1.0 / 6.0 - a2 / 120.0 * (1.0 - a2 / 42.0 * (1.0 - a2 / 72.0))
        d1 = -1.0 / 24.0 + a2 / 360.0 * (1.0 - a2 * 3.0 / 112.0)
        d2 = -1.0 / 120.0 + a2 / 2520.0 * (1.0 - a2 / 48.0)
        return s, c1, c2, d1, d2
    a = np.sqrt(a2)
    s = np.sin(a) / a
    c1 = (1.0 - np.cos(a)) / a2
    c2 = (1.0 - s) / a2
    return s, c1, c2, 0.5 * (s - 2.0 * c1) / a2, 0.5 * (c1 - 3.0 * c2) / a2


@compiled
def _relative_rotation(p: Floats, q: Floats) -> Vector:
    """Rotation vector from orientation p to orientation q, in the frame at p, shortest way."""
    w = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3]
    u, v = (p[1], p[2], p[3]), (q[1], q[2], q[3])
    d = _sum3(p[0], v, -q[0], u, -1.0, _cross(u, v))
    if w < 0.0:
        w, d = -w, (-d[0], -d[1], -d[2])
    half_sine = np.sqrt(_dot(d, d))
    scale = 2.0 / w if half_sine < 1e-9 else 2.0 * np.arctan2(half_sine, w) / half_sine
    return scale * d[0], scale * d[1], scale * d[2]


@compiled
def _rotation_vector_rate(phi: Vector, omega: Vector) -> Vector:
    """d(phi)/dt for a body rate (Bortz 1971): (I + [phi x]/2 + c3 [phi x]^2) omega."""
    a2 = _dot(phi, phi)
    if a2 < 1e-3:
        c3 = 1.0 / 12.0 + a2 / 720.0 * (1.0 + a2 / 42.0 * (1.0 + a2 / 40.0))
    else:
        a = np.sqrt(a2)
        c3 = (1.0 - 0.5 * a / np.tan(0.5 * a)) / a2
    once = _cross(phi, omega)
    return _sum3(1.0, omega, 0.5, once, c3, _cross(phi, once))


@compiled
def _turn_back(v: Vector, phi: Vector, s: float, c1: float) -> Vector:
    """``rotation_matrix(phi).T @ v``."""
    once = _cross(phi, v)
    return _sum3(1.0, v, -s, once, c1, _cross(phi, once))


@compiled
def _in_platform(q: Floats, v: Floats) -> Vector:
    """``C_nt.T @ v`` for a vector in n."""
    n = np.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
    w, u = q[0] / n, (-q[1] / n, -q[2] / n, -q[3] / n)
    a = (v[0], v[1], v[2])
    once = _cross(u, a)
    return _sum3(1.0, a, 2.0 * w, once, 2.0, _cross(u, once))


@compiled
def _turn_of_body(
    phi: Vector, rate: Vector, second: Vector, c1: float, c2: float, d1: float, d2: float
) -> tuple[Vector, Vector]:
    """Body rate and its derivative, of a rotation vector, its two derivatives and `_sine_terms`."""
    once = _cross(phi, rate)
    twice = _cross(phi, once)
    w = _sum3(1.0, rate, -c1, once, c2, twice)
    # The derivative of the line above; a2' is the rate of phi.phi.
    a2_rate = 2.0 * _dot(phi, rate)
    bend = _cross(phi, second)
    alpha = _sum3(1.0, second, -c1, bend, -d1 * a2_rate, once)
    alpha = _sum3(1.0, alpha, d2 * a2_rate, twice, c2, _cross(rate, once))
    return w, _sum3(1.0, alpha, c2, _cross(phi, bend), 0.0, (0.0, 0.0, 0.0))


@compiled
def _add_means(
    out: Floats, k: int, part: float, w: Vector, down: Vector, wt: Vector, alpha: Vector, field: Vector
) -> None:
    """Add the share `part` of an instant to column `k` of `mean_motion`, in place."""
    w2 = _dot(w, w)
    for i in range(3):
        out[i, k] += part * w[i]
        out[3 + i, k] += part * down[i]
        out[6 + i, k] += part * wt[i]
        out[9 + i, k] += part * alpha[i]
        out[12 + i, k] += part * field[i]
        for j in range(3):
            out[15 + 3 * i + j, k] += part * w[i] * w[j]
        out[15 + 4 * i, k] -= part * w2
    out[16, k] -= part * alpha[2]
    out[17, k] += part * alpha[1]
    out[18, k] += part * alpha[2]
    out[20, k] -= part * alpha[0]
    out[21, k] -= part * alpha[1]
    out[22, k] += part * alpha[0]


@compiled
def mean_motion(
    t: Floats, q_nt: Floats, omega_nt_t: Floats, edges: Floats, omega_ie_n: Floats, magnetic_n: Floats
) -> Floats:
    """Means over intervals of what a sensor fixed to the platform sees, resolved in t.

    Between two samples the relative rotation vector is the cubic with the given end rates: exact for
    constant angular acceleration about a fixed axis. Rates come from it by rotation-vector kinematics without
    approximation; means by Gauss-Legendre (three nodes) on the pieces between motion samples and edges.
    Before the first motion sample the platform rests in its first orientation.

    Parameters
    ----------
    t, q_nt, omega_nt_t : ndarray, shapes (n,), (n, 4), (n, 3)
        As in `PlatformMotion`.
    edges : ndarray, shape (m + 1,)
        Ends of the intervals (s), ascending, the last not after ``t[-1]`` but for rounding.
    omega_ie_n, magnetic_n : ndarray, shape (3,)
        Earth rate (rad/s) and magnetic field (T) in NED; n does not move over the Earth.

    Returns
    -------
    ndarray, shape (24, m)
        Rows as in `QUANTITIES`: "down" is the mean of C_tn (0, 0, 1); alpha is d(omega_ib_t)/dt; "lever" is the
        mean of ``[alpha x] + [omega_ib x]^2``, row-major, which times a lever arm is its acceleration.
    """
    close = 1e-9
    m = len(edges) - 1
    out = np.zeros((QUANTITIES, m))
    nodes = (0.5 - np.sqrt(15.0) / 10.0, 0.5, 0.5 + np.sqrt(15.0) / 10.0)
    weights = (5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0)
    down_n = np.array([0.0, 0.0, 1.0])
    zero = (0.0, 0.0, 0.0)
    at, prepared = -1, -2
    h, origin = 1.0, t[0]
    A, B, C = zero, zero, zero
    earth, down, field = zero, zero, zero
    for k in range(m):
        left, stop = edges[k], edges[k + 1]
        length = stop - left
        while left < stop:
            while at + 2 < len(t) and t[at + 1] <= left + close:
                at += 1
            right = stop
            if at + 1 < len(t) and left + close < t[at + 1] < stop - close:
                right = t[at + 1]
            if at != prepared:
                prepared = at
                i = max(at, 0)
                earth, down, field = (
                    _in_platform(q_nt[i], omega_ie_n),
                    _in_platform(q_nt[i], down_n),
                    _in_platform(q_nt[i], magnetic_n),
                )
                A, B, C, h, origin = zero, zero, zero, 1.0, t[i]
                if at >= 0:
                    h = t[i + 1] - t[i]
                    phi1 = _relative_rotation(q_nt[i], q_nt[i + 1])
                    w0 = (omega_nt_t[i, 0], omega_nt_t[i, 1], omega_nt_t[i, 2])
                    w1 = (omega_nt_t[i + 1, 0], omega_nt_t[i + 1, 1], omega_nt_t[i + 1, 2])
                    D = _rotation_vector_rate(phi1, w1)
                    A = (h * w0[0], h * w0[1], h * w0[2])
                    B = _sum3(3.0, phi1, -2.0, A, -h, D)
                    C = _sum3(-2.0, phi1, 1.0, A, h, D)
            for g in range(3):
                u = (left + nodes[g] * (right - left) - origin) / h
                phi = _sum3(u, A, u * u, B, u * u * u, C)
                rate = _sum3(1.0 / h, A, 2.0 * u / h, B, 3.0 * u * u / h, C)
                second = _sum3(2.0 / (h * h), B, 6.0 * u / (h * h), C, 0.0, zero)
                s, c1, c2, d1, d2 = _sine_terms(_dot(phi, phi))
                wt, alpha = _turn_of_body(phi, rate, second, c1, c2, d1, d2)
                earth_t = _turn_back(earth, phi, s, c1)
                down_t = _turn_back(down, phi, s, c1)
                field_t = _turn_back(field, phi, s, c1)
                w = _sum3(1.0, earth_t, 1.0, wt, 0.0, zero)
                alpha = _sum3(1.0, alpha, -1.0, _cross(wt, earth_t), 0.0, zero)
                part = weights[g] * (right - left) / length
                _add_means(out, k, part, w, down_t, wt, alpha, field_t)
            left = right
    return out
