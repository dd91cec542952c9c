"""Small matrices in compiled loops: those of 3x3 as nine numbers, row by row, because that allocates nothing.

A call of BLAS for a 3x3 product costs more than the product. Arrays are put into parts of others by loops: by indices,
numba also compiles the words of its error for shapes that differ, for seconds. Elements have any unit; those of
rotations are dimensionless.
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.compiled import compiled

Matrix3 = tuple[float, float, float, float, float, float, float, float, float]


@compiled
def rotation3(x: float, y: float, z: float) -> Matrix3:
    """Rotation matrix of a rotation vector (rad) by Rodrigues' formula, exact for every angle."""
    a2 = x * x + y * y + z * z
    if a2 < 1e-8:
        s, c = 1.0 - a2 / 6.0, 0.5 - a2 / 24.0
    else:
        a = np.sqrt(a2)
        s, c = np.sin(a) / a, (1.0 - np.cos(a)) / a2
    return (
        1.0 - c * (y * y + z * z),
        c * x * y - s * z,
        c * x * z + s * y,
        c * x * y + s * z,
        1.0 - c * (x * x + z * z),
        c * y * z - s * x,
        c * x * z - s * y,
        c * y * z + s * x,
        1.0 - c * (x * x + y * y),
    )


@compiled
def elements(C: Floats) -> Matrix3:
    """Take the elements of an array.

    Parameters
    ----------
    C : ndarray, shape (3, 3)
    """
    return C[0, 0], C[0, 1], C[0, 2], C[1, 0], C[1, 1], C[1, 2], C[2, 0], C[2, 1], C[2, 2]


@compiled
def store(m: Matrix3, out: Floats) -> None:
    """Write elements to an array.

    Parameters
    ----------
    out : ndarray, shape (3, 3)
        Filled in place.
    """
    out[0, 0], out[0, 1], out[0, 2] = m[0], m[1], m[2]
    out[1, 0], out[1, 1], out[1, 2] = m[3], m[4], m[5]
    out[2, 0], out[2, 1], out[2, 2] = m[6], m[7], m[8]


@compiled
def transposed(m: Matrix3) -> Matrix3:
    """Transpose."""
    return m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]


@compiled
def multiplied(a: Matrix3, b: Matrix3) -> Matrix3:
    """Product ``a @ b``."""
    return (
        a[0] * b[0] + a[1] * b[3] + a[2] * b[6],
        a[0] * b[1] + a[1] * b[4] + a[2] * b[7],
        a[0] * b[2] + a[1] * b[5] + a[2] * b[8],
        a[3] * b[0] + a[4] * b[3] + a[5] * b[6],
        a[3] * b[1] + a[4] * b[4] + a[5] * b[7],
        a[3] * b[2] + a[4] * b[5] + a[5] * b[8],
        a[6] * b[0] + a[7] * b[3] + a[8] * b[6],
        a[6] * b[1] + a[7] * b[4] + a[8] * b[7],
        a[6] * b[2] + a[7] * b[5] + a[8] * b[8],
    )


@compiled
def applied(m: Matrix3, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Product of a matrix and a vector."""
    return m[0] * x + m[1] * y + m[2] * z, m[3] * x + m[4] * y + m[5] * z, m[6] * x + m[7] * y + m[8] * z


@compiled
def orthonormal3(m: Matrix3) -> Matrix3:
    """Rotation matrix nearest to one with rounding errors: ``1.5 m - 0.5 m m' m`` (one Newton step)."""
    b = multiplied(multiplied(m, transposed(m)), m)
    return (
        1.5 * m[0] - 0.5 * b[0],
        1.5 * m[1] - 0.5 * b[1],
        1.5 * m[2] - 0.5 * b[2],
        1.5 * m[3] - 0.5 * b[3],
        1.5 * m[4] - 0.5 * b[4],
        1.5 * m[5] - 0.5 * b[5],
        1.5 * m[6] - 0.5 * b[6],
        1.5 * m[7] - 0.5 * b[7],
        1.5 * m[8] - 0.5 * b[8],
    )


@compiled
def put(block: Floats, out: Floats, row: int, column: int) -> None:
    """Write a block to a part of a matrix.

    Parameters
    ----------
    block : ndarray, shape (m, n)
        Any units.
    out : ndarray, shape (row + m or more, column + n or more)
        Filled in place from its element (row, column) on.
    row, column : int
        First of each.
    """
    for i in range(block.shape[0]):
        for j in range(block.shape[1]):
            out[row + i, column + j] = block[i, j]


@compiled
def corner(A: Floats, row: int, column: int) -> Floats:
    """Copy the part of a matrix from an element on.

    Parameters
    ----------
    A : ndarray, shape (m, n)
        Any units.
    row, column : int
        First of each.

    Returns
    -------
    ndarray, shape (m - row, n - column)
        Contiguous.
    """
    out = np.empty((A.shape[0] - row, A.shape[1] - column))
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = A[row + i, column + j]
    return out


@compiled
def sparse_product(A: Floats, B: Floats) -> Floats:
    """Product ``A @ B`` that skips the zeros of A.

    Parameters
    ----------
    A, B : ndarray, shapes (m, n) and (n, q)
        Any units.

    Returns
    -------
    ndarray, shape (m, q)
    """
    out = np.zeros((A.shape[0], B.shape[1]))
    for i in range(A.shape[0]):
        for k in range(A.shape[1]):
            a = A[i, k]
            if a != 0.0:
                for j in range(B.shape[1]):
                    out[i, j] += a * B[k, j]
    return out
