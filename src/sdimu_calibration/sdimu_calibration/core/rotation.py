"""Rotations: matrices, quaternions (scalar first), rotation vectors. Compiled; usable from Python too.

`C_nb` maps b to n and `q_nb` is the same rotation. A rotation vector `phi` with
``C = rotation_matrix(phi)`` turns the frame it is resolved in: ``C_nb(t+dt) = C_nb(t) @ rotation_matrix(phi_b)``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sdimu_calibration.core.compiled import compiled

Floats = NDArray[np.float64]


@compiled
def skew(v: Floats) -> Floats:
    """Cross-product matrix: ``skew(a) @ b == cross(a, b)``; `v` shape (3,)."""
    m = np.zeros((3, 3))
    m[0, 1], m[0, 2] = -v[2], v[1]
    m[1, 0], m[1, 2] = v[2], -v[0]
    m[2, 0], m[2, 1] = -v[1], v[0]
    return m


@compiled
def cross(a: Floats, b: Floats) -> Floats:
    """Cross product of two vectors of shape (3,)."""
    c = np.empty(3)
    c[0] = a[1] * b[2] - a[2] * b[1]
    c[1] = a[2] * b[0] - a[0] * b[2]
    c[2] = a[0] * b[1] - a[1] * b[0]
    return c


@compiled
def rotation_matrix(phi: Floats) -> Floats:
    """Rotation matrix of a rotation vector (Rodrigues), exact for every angle.

    Parameters
    ----------
    phi : ndarray, shape (3,)
        Rotation vector (rad).

    Returns
    -------
    ndarray, shape (3, 3)
        ``I + sin(a)/a [phi x] + (1 - cos(a))/a^2 [phi x]^2``.
    """
    a2 = phi[0] ** 2 + phi[1] ** 2 + phi[2] ** 2
    if a2 < 1e-8:
        s, c = 1.0 - a2 / 6.0, 0.5 - a2 / 24.0
    else:
        a = np.sqrt(a2)
        s, c = np.sin(a) / a, (1.0 - np.cos(a)) / a2
    m = np.empty((3, 3))
    x, y, z = phi[0], phi[1], phi[2]
    m[0, 0] = 1.0 - c * (y * y + z * z)
    m[1, 1] = 1.0 - c * (x * x + z * z)
    m[2, 2] = 1.0 - c * (x * x + y * y)
    m[0, 1], m[1, 0] = c * x * y - s * z, c * x * y + s * z
    m[0, 2], m[2, 0] = c * x * z + s * y, c * x * z - s * y
    m[1, 2], m[2, 1] = c * y * z - s * x, c * y * z + s * x
    return m


@compiled
def rotation_vector(C: Floats) -> Floats:
    """Rotation vector of a rotation matrix, angle in [0, pi]; the inverse of `rotation_matrix`."""
    w = np.empty(3)
    w[0], w[1], w[2] = C[2, 1] - C[1, 2], C[0, 2] - C[2, 0], C[1, 0] - C[0, 1]
    sin2 = np.sqrt(w[0] ** 2 + w[1] ** 2 + w[2] ** 2)
    cos2 = C[0, 0] + C[1, 1] + C[2, 2] - 1.0
    angle = np.arctan2(sin2, cos2)
    if sin2 > 1e-7:
        w *= angle / sin2
        return w
    if cos2 > 0.0:
        w *= 0.5
        return w
    # Half a turn: the axis is the column of C + I with the largest diagonal.
    k = 0
    for i in range(1, 3):
        if C[i, i] > C[k, k]:
            k = i
    axis = C[:, k].copy()
    axis[k] += 1.0
    axis *= angle / np.sqrt(axis[0] ** 2 + axis[1] ** 2 + axis[2] ** 2)
    return axis


@compiled
def orthonormal(C: Floats) -> Floats:
    """Give the nearest rotation matrix to one that rounding has bent a little (one Newton step)."""
    return 1.5 * C - 0.5 * C @ C.T @ C


@compiled
def quaternion(C: Floats) -> Floats:
    """Convert a rotation matrix to a unit quaternion (w, x, y, z), w >= 0."""
    phi = rotation_vector(C)
    a = np.sqrt(phi[0] ** 2 + phi[1] ** 2 + phi[2] ** 2)
    q = np.empty(4)
    q[0] = np.cos(0.5 * a)
    s = 0.5 - a * a / 48.0 if a < 1e-4 else np.sin(0.5 * a) / a
    q[1], q[2], q[3] = s * phi[0], s * phi[1], s * phi[2]
    return q


@compiled
def quaternion_matrix(q: Floats) -> Floats:
    """Rotation matrix of a quaternion (w, x, y, z); it is normalised first."""
    n = np.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
    w, x, y, z = q[0] / n, q[1] / n, q[2] / n, q[3] / n
    m = np.empty((3, 3))
    m[0, 0], m[0, 1], m[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    m[1, 0], m[1, 1], m[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    m[2, 0], m[2, 1], m[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
    return m
