"""What noise in the model takes of the information on something else: a Schur complement by Cholesky factors.

With M = I + R'JR = LL' the information on modes of unit variance, y = R'd their pull and B the information across, they
take ``B M^-1 B' = Z'Z`` with ``Z = L^-1 B'``; the log-likelihood that they add is ``|L^-1 y|^2 / 2 - log det L``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats


@dataclass(frozen=True)
class Taken:
    """What r modes take of the information on m other parameters."""

    L: Floats
    """Cholesky factor of the information on the modes (1), shape (r, r)."""
    Z: Floats
    """Shape (r, m). In the root of the unit of the other information."""
    z: Floats
    """Pull of the modes (1), shape (r,)."""

    @property
    def J(self) -> Floats:
        """What is taken of the information matrix.

        Returns
        -------
        ndarray, shape (m, m)
            In its unit.
        """
        return np.asarray(self.Z.T @ self.Z)

    @property
    def d(self) -> Floats:
        """What is taken of the information vector.

        Returns
        -------
        ndarray, shape (m,)
            In its unit.
        """
        return np.asarray(self.z @ self.Z)

    @property
    def gain(self) -> float:
        """Log-likelihood that the modes add (1)."""
        return 0.5 * float(self.z @ self.z) - float(np.log(np.diag(self.L)).sum())


def nothing_taken(m: int) -> Taken:
    """Give what no modes take of the information on m parameters."""
    return Taken(np.zeros((0, 0)), np.zeros((0, m)), np.zeros(0))


def taken(M: Floats, y: Floats, across: Floats) -> Taken:
    """Work out what modes take.

    Parameters
    ----------
    M : ndarray, shape (r, r)
        Information on the modes with what is known of them before the data (1).
    y : ndarray, shape (r,)
        Their pull (1).
    across : ndarray, shape (m, r)
        Information across the others and the modes.
    """
    L = factor(M)
    Z = divided(L, np.vstack([across, y]))
    return Taken(L, Z[:, :-1], Z[:, -1])


def factor(M: Floats) -> Floats:
    """Take the Cholesky factor of the information on modes.

    Parameters
    ----------
    M : ndarray, shape (r, r)
        (1).

    Returns
    -------
    ndarray, shape (r, r)
        (1).
    """
    if not M.size:
        return M
    from scipy.linalg import lapack  # noqa: PLC0415 (0.1 s that a calibration in white noise does not need)

    L, failed = lapack.dpotrf(M.T, lower=1)
    if failed:
        raise np.linalg.LinAlgError("the information on noise is no covariance")
    return np.asarray(L)


def divided(L: Floats, rows: Floats, turned: bool = False) -> Floats:
    """Divide by a Cholesky factor, ``L^-1 rows'``, or by its transpose where it is `turned`.

    Parameters
    ----------
    L : ndarray, shape (r, r)
        (1).
    rows : ndarray, shape (m, r)
        In any unit.

    Returns
    -------
    ndarray, shape (r, m)
        In the same unit.
    """
    if not L.size:
        return np.zeros((0, len(rows)))
    from scipy.linalg import blas  # noqa: PLC0415 (as above)

    return np.asarray(blas.dtrsm(1.0, L, rows.T, lower=1, trans_a=int(turned)))
