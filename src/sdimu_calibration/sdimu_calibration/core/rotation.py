"""Rotations: matrices, quaternions (scalar first), rotation vectors. Compiled; usable from Python too.

`C_nb` maps b to n and `q_nb` is the same rotation. A rotation vector `phi` with
``C = rotation_matrix(phi)`` turns the frame it is resolved in: ``C_nb(t+dt) = C_nb(t) @ rotation_matrix(phi_b)``.
Rotation vectors are in rad; matrices and quaternions are dimensionless.

Source: Shuster, "A Survey of Attitude Representations", J. Astronautical Sciences 41 (1993).
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.matrix3 import elements, orthonormal3, rotation3, store


@compiled
def skew(v: Floats) -> Floats:
    """Cross-product matrix: ``skew(a) @ b == cross(a, b)``.

    Parameters
    ----------
    v : ndarray, shape (3,)
        Any unit.

    Returns
    -------
    ndarray, shape (3, 3)
        In the unit of `v`.
    """
    m = np.zeros((3, 3))
    m[0, 1], m[0, 2] = -v[2], v[1]
    m[1, 0], m[1, 2] = v[2], -v[0]
    m[2, 0], m[2, 1] = -v[1], v[0]
    return m


@compiled
def cross(a: Floats, b: Floats) -> Floats:
    """Cross product of two vectors.

    Parameters
    ----------
    a, b : ndarray, shape (3,)
        Any units, one frame.

    Returns
    -------
    ndarray, shape (3,)
    """
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
    m = np.empty((3, 3))
    store(rotation3(phi[0], phi[1], phi[2]), m)
    return m


@compiled
def quaternion(C: Floats) -> Floats:
    """Give the unit quaternion (w, x, y, z), w >= 0, of a rotation matrix.

    Divides by the largest of the four components, so no angle loses digits (Shepperd, J. Guidance and Control 1, 1978).

    Parameters
    ----------
    C : ndarray, shape (3, 3)

    Returns
    -------
    ndarray, shape (4,)
    """
    q = np.empty(4)
    trace = C[0, 0] + C[1, 1] + C[2, 2]
    k = 0
    for i in range(1, 3):
        if C[i, i] > C[k, k]:
            k = i
    if trace >= C[k, k]:
        s = 2.0 * np.sqrt(1.0 + trace)
        q[0] = 0.25 * s
        q[1], q[2], q[3] = (C[2, 1] - C[1, 2]) / s, (C[0, 2] - C[2, 0]) / s, (C[1, 0] - C[0, 1]) / s
    else:
        i, j = (k + 1) % 3, (k + 2) % 3
        s = 2.0 * np.sqrt(1.0 + C[k, k] - C[i, i] - C[j, j])
        q[0] = (C[j, i] - C[i, j]) / s
        q[1 + k] = 0.25 * s
        q[1 + i], q[1 + j] = (C[i, k] + C[k, i]) / s, (C[j, k] + C[k, j]) / s
    if q[0] < 0.0:
        q *= -1.0
    return q


@compiled
def rotation_vector(C: Floats) -> Floats:
    """Rotation vector of a rotation matrix, angle in [0, pi]; the inverse of `rotation_matrix`.

    Parameters
    ----------
    C : ndarray, shape (3, 3)

    Returns
    -------
    ndarray, shape (3,)
    """
    q = quaternion(C)
    n = np.sqrt(q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
    scale = 2.0 if n < 1e-12 else 2.0 * np.arctan2(n, q[0]) / n
    return scale * q[1:]


@compiled
def orthonormal(C: Floats) -> Floats:
    """Give the rotation matrix nearest to one with rounding errors (one Newton step).

    Parameters
    ----------
    C : ndarray, shape (3, 3)
        Orthonormal but for a small error e; what is left is of the order of e^2.

    Returns
    -------
    ndarray, shape (3, 3)
    """
    out = np.empty((3, 3))
    store(orthonormal3(elements(C)), out)
    return out


@compiled
def quaternion_matrix(q: Floats) -> Floats:
    """Rotation matrix of a quaternion.

    Parameters
    ----------
    q : ndarray, shape (4,)
        (w, x, y, z) of any length but zero; the function normalises it.

    Returns
    -------
    ndarray, shape (3, 3)
    """
    n = np.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
    w, x, y, z = q[0] / n, q[1] / n, q[2] / n, q[3] / n
    m = np.empty((3, 3))
    m[0, 0], m[0, 1], m[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    m[1, 0], m[1, 1], m[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    m[2, 0], m[2, 1], m[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
    return m
