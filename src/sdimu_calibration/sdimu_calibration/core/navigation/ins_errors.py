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
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.compiled import compiled


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
    dc[:, :3] = 2.0 * d_ie + d_en_p
    dc[:, 3:] = d_en_v
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
    F[6:9, 0:3] += d_ie + d_en_p
    F[6:9, 3:6] += d_en_v
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
    A = F * dt
    A2 = A @ A
    return np.eye(9) + A + 0.5 * A2 + (A2 @ A) / 6.0


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
    Xg = X @ C_qg
    XgX = Xg @ X.T
    Q = np.zeros((9, 9))
    Q[6:9, 6:9] = C_qg * dt
    Q[3:6, 6:9] = Xg * (dt**2 / 2.0)
    Q[3:6, 3:6] = C_qa * dt + XgX * (dt**3 / 3.0)
    Q[0:3, 6:9] = Xg * (dt**3 / 6.0)
    Q[0:3, 3:6] = C_qa * (dt**2 / 2.0) + XgX * (dt**4 / 8.0)
    Q[0:3, 0:3] = C_qa * (dt**3 / 3.0) + XgX * (dt**5 / 20.0)
    Q[6:9, 3:6] = Q[3:6, 6:9].T
    Q[6:9, 0:3] = Q[0:3, 6:9].T
    Q[3:6, 0:3] = Q[0:3, 3:6].T
    return Q


@compiled
def add_response(G: Floats, att: Floats, vel: Floats, f_n: Floats, w_ie: Floats, dt: float) -> None:
    """Add one cycle to the integrated response of the navigation errors to each coefficient.

    Includes the Coriolis force on the velocity gained since the start of the epoch: a lever arm moves at decimetres per
    second.

    Parameters
    ----------
    G : ndarray, shape (9, p)
        Response since the start of the epoch, per unit of each coefficient; changed in place.
    att, vel : ndarray, shape (3, p)
        Attitude (rad) and velocity (m/s) that the sensor errors of this cycle add, in n, per unit.
    f_n : ndarray, shape (3,)
        Specific force (m/s^2).
    w_ie : ndarray, shape (3,)
        Earth rate in n (rad/s).
    dt : float
        Length of the cycle (s).
    """
    c0, c2 = -2.0 * w_ie[0] * dt, -2.0 * w_ie[2] * dt
    for j in range(G.shape[1]):
        a0, a1, a2 = G[6, j] + 0.5 * att[0, j], G[7, j] + 0.5 * att[1, j], G[8, j] + 0.5 * att[2, j]
        u0, u1, u2 = G[3, j] + 0.5 * vel[0, j], G[4, j] + 0.5 * vel[1, j], G[5, j] + 0.5 * vel[2, j]
        v0 = vel[0, j] + (f_n[1] * a2 - f_n[2] * a1) * dt - c2 * u1
        v1 = vel[1, j] + (f_n[2] * a0 - f_n[0] * a2) * dt + c2 * u0 - c0 * u2
        v2 = vel[2, j] + (f_n[0] * a1 - f_n[1] * a0) * dt + c0 * u1
        G[0, j] += (G[3, j] + 0.5 * v0) * dt
        G[1, j] += (G[4, j] + 0.5 * v1) * dt
        G[2, j] += (G[5, j] + 0.5 * v2) * dt
        G[3, j] += v0
        G[4, j] += v1
        G[5, j] += v2
        G[6, j] += att[0, j]
        G[7, j] += att[1, j]
        G[8, j] += att[2, j]
