"""Dynamics of the nine navigation errors, F11, in local-level NED.

State: position error N, E, D (m), velocity error N, E, D (m/s), attitude error N, E, D (rad); errors are
computed minus true and ``C_nb(computed) = (I - [err_attitude x]) C_nb(true)``.

Source: Titterton & Weston, *Strapdown Inertial Navigation Technology*, 2nd ed., section 12.3; the same in
Britting, *Inertial Navigation Systems Analysis*, ch. 6. Here position errors are metres, so the transport
rate contains the division by the radii.
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.matrix3 import sparse_product


@compiled
def navigation_error_matrix(position: Floats, velocity: Floats, f_n: Floats) -> Floats:
    """F11 of ``d/dt error = F11 error``.

    Parameters
    ----------
    position : ndarray, shape (3,)
        Latitude (rad), longitude (rad), height (m).
    velocity : ndarray, shape (3,)
        N, E, D (m/s).
    f_n : ndarray, shape (3,)
        Specific force in NED (m/s^2).

    Returns
    -------
    ndarray, shape (9, 9)
    """
    lat = min(max(position[0], -earth.POLE_LIMIT), earth.POLE_LIMIT)
    r_n, r_e = earth.radii(lat)
    r_n += position[2]
    r_e += position[2]
    tan, cos = np.tan(lat), np.cos(lat)
    v_n, v_e, v_d = velocity[0], velocity[1], velocity[2]
    w_n, w_d = earth.RATE * np.cos(position[0]), -earth.RATE * np.sin(position[0])
    # Transport rate and its partial derivatives with respect to latitude, height (= -D) and velocity.
    t_n, t_e, t_d = v_e / r_e, -v_n / r_n, -v_e * tan / r_e

    d_ie = np.zeros((3, 3))  # change of Earth rate with position error (N, E, D in metres)
    d_ie[0, 0], d_ie[2, 0] = w_d / r_n, -w_n / r_n
    d_en_p = np.zeros((3, 3))  # change of transport rate with position error
    d_en_p[0, 2], d_en_p[1, 2], d_en_p[2, 2] = t_n / r_e, t_e / r_n, t_d / r_e
    d_en_p[2, 0] = -v_e / (r_e * cos * cos) / r_n
    d_en_v = np.zeros((3, 3))
    d_en_v[0, 1], d_en_v[1, 0], d_en_v[2, 1] = 1.0 / r_e, -1.0 / r_n, -tan / r_e

    F = np.zeros((9, 9))
    # Position errors are small lengths along axes that turn with the transport rate.
    F[0, 3] = F[1, 4] = F[2, 5] = 1.0
    F[0, 0], F[0, 2] = -v_d / r_n, v_n / r_n
    F[1, 0], F[1, 1], F[1, 2] = v_e * tan / r_n, -v_d / r_e - v_n * tan / r_n, v_e / r_e
    # Velocity: f x attitude, Coriolis, gravity gradient.
    F[3, 7], F[3, 8] = -f_n[2], f_n[1]
    F[4, 6], F[4, 8] = f_n[2], -f_n[0]
    F[5, 6], F[5, 7] = -f_n[1], f_n[0]
    c_n, c_e, c_d = 2.0 * w_n + t_n, t_e, 2.0 * w_d + t_d
    F[3, 4] += c_d
    F[3, 5] -= c_e
    F[4, 3] -= c_d
    F[4, 5] += c_n
    F[5, 3] += c_e
    F[5, 4] -= c_n
    dc = np.zeros((3, 6))  # change of the Coriolis rate 2 w_ie + w_en with position and velocity error
    for i in range(3):
        for j in range(3):
            dc[i, j] = 2.0 * d_ie[i, j] + d_en_p[i, j]
            dc[i, 3 + j] = d_en_v[i, j]
    for j in range(6):
        F[3, j] -= dc[1, j] * v_d - dc[2, j] * v_e
        F[4, j] -= dc[2, j] * v_n - dc[0, j] * v_d
        F[5, j] -= dc[0, j] * v_e - dc[1, j] * v_n
    gravity = earth.normal_gravity(position[0], position[2])
    F[5, 2] += 2.0 * gravity / np.sqrt(r_n * r_e)
    # Attitude.
    F[6, 7], F[6, 8] = w_d + t_d, -t_e
    F[7, 6], F[7, 8] = -(w_d + t_d), w_n + t_n
    F[8, 6], F[8, 7] = t_e, -(w_n + t_n)
    for i in range(3):
        for j in range(3):
            F[6 + i, j] += d_ie[i, j] + d_en_p[i, j]
            F[6 + i, 3 + j] += d_en_v[i, j]
    return F


@compiled
def transition(F: Floats, dt: float) -> Floats:
    """Transition matrix: the exponential of ``F dt`` to third order.

    Parameters
    ----------
    F : ndarray, shape (9, 9)
    dt : float
        Length of the epoch (s); the first term left out is ``(F dt)^4 / 24``, 2e-12 in natural units at 1 s.

    Returns
    -------
    ndarray, shape (9, 9)
    """
    A = np.empty((9, 9))
    for i in range(9):
        for j in range(9):
            A[i, j] = F[i, j] * dt
    A2 = sparse_product(A, A)
    out = sparse_product(A, A2)
    for i in range(9):
        for j in range(9):
            out[i, j] = (1.0 if i == j else 0.0) + A[i, j] + 0.5 * A2[i, j] + out[i, j] / 6.0
    return out


@compiled
def process_noise(C_qg: Floats, C_qa: Floats, f_n: Floats, dt: float) -> Floats:
    """Covariance that white gyro and accelerometer noise builds up over an epoch.

    Parameters
    ----------
    C_qg, C_qa : ndarray, shape (3, 3)
        Power spectral densities of gyro ((rad/s)^2/Hz) and accelerometer noise ((m/s^2)^2/Hz), in n.
    f_n : ndarray, shape (3,)
        Mean specific force (m/s^2).
    dt : float
        Length of the epoch (s).

    Returns
    -------
    ndarray, shape (9, 9)
        The integral of ``Phi G q G' Phi'`` with F11 reduced to ``v' = f x attitude``, ``p' = v``, which is
        exact for constant f_n but for Earth and transport rate (relative 1e-4 for a second).
    """
    X = np.zeros((3, 3))
    X[0, 1], X[0, 2] = -f_n[2], f_n[1]
    X[1, 0], X[1, 2] = f_n[2], -f_n[0]
    X[2, 0], X[2, 1] = -f_n[1], f_n[0]
    Xg = sparse_product(X, C_qg)
    XgX = sparse_product(Xg, X.T)
    Q = np.zeros((9, 9))
    for i in range(3):
        for j in range(3):
            Q[6 + i, 6 + j] = C_qg[i, j] * dt
            Q[3 + i, 6 + j] = Xg[i, j] * (dt**2 / 2.0)
            Q[3 + i, 3 + j] = C_qa[i, j] * dt + XgX[i, j] * (dt**3 / 3.0)
            Q[i, 6 + j] = Xg[i, j] * (dt**3 / 6.0)
            Q[i, 3 + j] = C_qa[i, j] * (dt**2 / 2.0) + XgX[i, j] * (dt**4 / 8.0)
            Q[i, j] = C_qa[i, j] * (dt**3 / 3.0) + XgX[i, j] * (dt**5 / 20.0)
            Q[6 + j, 3 + i], Q[6 + j, i], Q[3 + j, i] = Q[3 + i, 6 + j], Q[i, 6 + j], Q[i, 3 + j]
    return Q


@compiled
def responses(C_nb: Floats, f_n: Floats, dt: Floats, first: int, last: int, w_ie: Floats, out: Floats) -> None:
    """Response of the navigation at the end of an epoch to an error of each sensor axis in each of its cycles.

    An error ``v(c)`` of axis a moves the navigation by the sum over the cycles of ``out[c, a] * v(c)``, whatever effect
    makes it, so the response is found once and serves all coefficients. With the Coriolis force on the velocity gained
    since the epoch began: a lever arm moves by decimetres a second.

    Parameters
    ----------
    C_nb : ndarray, shape (n, 3, 3)
        Mean attitude of each cycle.
    f_n : ndarray, shape (n, 3)
        Specific force in NED (m/s^2).
    dt : ndarray, shape (n,)
        Length of each cycle (s).
    first, last : int
        Cycles of the epoch.
    w_ie : ndarray, shape (3,)
        Earth rate in NED (rad/s).
    out : ndarray, shape (n, 6, 9)
        Filled for the cycles of the epoch: gyro x, y, z (per rad/s), accelerometer x, y, z (per m/s^2).
    """
    # Transition from the end of a cycle to the end of the epoch: position by velocity and by attitude, velocity by
    # velocity and by attitude. All other blocks are unity or zero.
    pv, pa, vv, va = np.zeros((3, 3)), np.zeros((3, 3)), np.eye(3), np.zeros((3, 3))
    V, A, x, y = np.empty((3, 3)), np.empty((3, 3)), np.empty(3), np.empty(3)
    for c in range(last - 1, first - 1, -1):
        h = dt[c]
        f0, f1, f2 = f_n[c, 0] * h, f_n[c, 1] * h, f_n[c, 2] * h
        c0, c2 = -2.0 * w_ie[0] * h, -2.0 * w_ie[2] * h
        for a in range(3):
            # An angle a in the cycle: velocity by half of it, ...
            a0, a1, a2 = -C_nb[c, 0, a] * h, -C_nb[c, 1, a] * h, -C_nb[c, 2, a] * h
            x[0], x[1], x[2] = 0.5 * (f1 * a2 - f2 * a1), 0.5 * (f2 * a0 - f0 * a2), 0.5 * (f0 * a1 - f1 * a0)
            # ... a velocity u in the cycle: by itself and half of its Coriolis force.
            u0, u1, u2 = C_nb[c, 0, a] * h, C_nb[c, 1, a] * h, C_nb[c, 2, a] * h
            y[0] = u0 - 0.5 * c2 * u1
            y[1] = u1 + 0.5 * (c2 * u0 - c0 * u2)
            y[2] = u2 + 0.5 * c0 * u1
            for i in range(3):
                out[c, a, i] = 0.5 * h * x[i] + pv[i, 0] * x[0] + pv[i, 1] * x[1] + pv[i, 2] * x[2]
                out[c, a, i] += pa[i, 0] * a0 + pa[i, 1] * a1 + pa[i, 2] * a2
                out[c, a, 3 + i] = vv[i, 0] * x[0] + vv[i, 1] * x[1] + vv[i, 2] * x[2]
                out[c, a, 3 + i] += va[i, 0] * a0 + va[i, 1] * a1 + va[i, 2] * a2
                out[c, 3 + a, i] = 0.5 * h * y[i] + pv[i, 0] * y[0] + pv[i, 1] * y[1] + pv[i, 2] * y[2]
                out[c, 3 + a, 3 + i] = vv[i, 0] * y[0] + vv[i, 1] * y[1] + vv[i, 2] * y[2]
                out[c, 3 + a, 6 + i] = 0.0
            out[c, a, 6], out[c, a, 7], out[c, a, 8] = a0, a1, a2
        # One cycle further back: over the cycle velocity becomes V velocity + A attitude, position adds its mean.
        V[0, 0], V[0, 1], V[0, 2] = 1.0, -c2, 0.0
        V[1, 0], V[1, 1], V[1, 2] = c2, 1.0, -c0
        V[2, 0], V[2, 1], V[2, 2] = 0.0, c0, 1.0
        A[0, 0], A[0, 1], A[0, 2] = 0.0, -f2, f1
        A[1, 0], A[1, 1], A[1, 2] = f2, 0.0, -f0
        A[2, 0], A[2, 1], A[2, 2] = -f1, f0, 0.0
        for i in range(3):
            for j in range(3):
                pa[i, j] += 0.5 * h * A[i, j] + pv[i, 0] * A[0, j] + pv[i, 1] * A[1, j] + pv[i, 2] * A[2, j]
                va[i, j] += vv[i, 0] * A[0, j] + vv[i, 1] * A[1, j] + vv[i, 2] * A[2, j]
            q0, q1, q2 = pv[i, 0], pv[i, 1], pv[i, 2]
            r0, r1, r2 = vv[i, 0], vv[i, 1], vv[i, 2]
            for j in range(3):
                pv[i, j] = 0.5 * h * (V[i, j] + (1.0 if i == j else 0.0)) + q0 * V[0, j] + q1 * V[1, j] + q2 * V[2, j]
                vv[i, j] = r0 * V[0, j] + r1 * V[1, j] + r2 * V[2, j]


@compiled
def add_columns(values: Floats, channel: Ints, parameter: Ints, R: Floats, dt: Floats, G: Floats, D: Floats) -> None:
    """Response over an epoch to parameters whose regressors are given, in place.

    Parameters
    ----------
    values : ndarray, shape (n, m)
        Regressors of the cycles of the epoch.
    channel, parameter : ndarray of int, shape (m,)
        Sensor axis and parameter of each column.
    R : ndarray, shape (n, 6, 9)
        As `responses` leaves it.
    dt : ndarray, shape (n,)
        Length of each cycle (s).
    G, D : ndarray, shapes (9, p) and (6, p)
        Filled with the response of the navigation, and with the integral of the regressors for each sensor axis.
    """
    G[:, :] = 0.0
    D[:, :] = 0.0
    for j in range(channel.shape[0]):
        ch, k = channel[j], parameter[j]
        g0, g1, g2, g3, g4, g5, g6, g7, g8, total = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for c in range(dt.shape[0]):
            v = values[c, j]
            if v != 0.0:
                g0 += R[c, ch, 0] * v
                g1 += R[c, ch, 1] * v
                g2 += R[c, ch, 2] * v
                g3 += R[c, ch, 3] * v
                g4 += R[c, ch, 4] * v
                g5 += R[c, ch, 5] * v
                g6 += R[c, ch, 6] * v
                g7 += R[c, ch, 7] * v
                g8 += R[c, ch, 8] * v
                total += v * dt[c]
        G[0, k] += g0
        G[1, k] += g1
        G[2, k] += g2
        G[3, k] += g3
        G[4, k] += g4
        G[5, k] += g5
        G[6, k] += g6
        G[7, k] += g7
        G[8, k] += g8
        D[ch, k] += total
