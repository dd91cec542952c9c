"""Likelihood of the size of noise, for many sizes: one reduction to a tridiagonal matrix, then a loop for each size.

With A = QTQ', T tridiagonal, and the first column of Q along b,

    b' (I + vA)^-1 b = |b|^2 / c_1,   det(I + vA) = c_1 c_2 ... c_m,
    c_m = 1 + v t_m,   c_k = 1 + v t_k - v^2 u_k^2 / c_(k+1),

t_k the diagonal of T and u_k beside it. That is a third of the work of eigenvectors. Source: G. Golub, G. Meurant,
"Matrices, Moments and Quadrature with Applications" (2010), chapters 3 and 6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.compiled import compiled

_WORK = 64
"""Numbers (1) of work space for each row: the block in which LAPACK reduces a symmetric matrix."""

_HALVINGS = 40
"""Number of times (1) that the span of an eigenvalue is halved: to a billionth of a span that is at most thrice it."""


@dataclass(frozen=True)
class Tridiagonal:
    """Information on m modes and on what they pull, turned until the modes are a chain that begins at the pull."""

    own: Floats
    """Diagonal of T (1), shape (m,)."""
    beside: Floats
    """What stands beside it (1), shape (m - 1,)."""
    pull2: float
    """Square of the information vector (1)."""

    @classmethod
    def of(cls, J: Floats, d: Floats) -> Tridiagonal:
        """Reduce information.

        Parameters
        ----------
        J : ndarray, shape (m, m)
            Its upper half is read (1).
        d : ndarray, shape (m,)
            (1).
        """
        from scipy.linalg.lapack import dsytrd  # noqa: PLC0415 (0.1 s that a calibration in white noise does not need)

        m = len(d)
        # With the vector as a row before it, the reduction begins at the vector; LAPACK reads columns for rows.
        bordered = np.zeros((m + 1, m + 1))
        bordered[1:, 1:], bordered[0, 1:] = J, d
        _, own, beside, _, _ = dsytrd(bordered.T, lower=1, lwork=_WORK * (m + 1), overwrite_a=1)
        return cls(own[1:], beside[1:], float(d @ d))

    @property
    def largest(self) -> float:
        """Information on the mode that is known best (1)."""
        return float(largest_eigenvalue(self.own, self.beside))

    def gain(self, variance: Floats) -> Floats:
        """Log-likelihood of noise of each variance in all modes, over that of none.

        Parameters
        ----------
        variance : ndarray, shape (v,)
            In units of that of the modes (1).

        Returns
        -------
        ndarray, shape (v,)
            (1).
        """
        return chained(variance, self.own, self.beside, self.pull2)


@compiled
def largest_eigenvalue(own: Floats, beside: Floats) -> float:
    """Largest eigenvalue of a tridiagonal matrix, by bisection.

    Parameters
    ----------
    own : ndarray, shape (m,)
        Its diagonal.
    beside : ndarray, shape (m - 1,)
        What stands beside it.

    Returns
    -------
    float
        In the unit of the matrix.
    """
    low, high = own[0], own[0]
    for k in range(len(own)):
        reach = (abs(beside[k - 1]) if k > 0 else 0.0) + (abs(beside[k]) if k < len(beside) else 0.0)
        low, high = max(low, own[k]), max(high, own[k] + reach)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        # Above all eigenvalues where every pivot of the difference is positive.
        pivot = middle - own[0]
        k = 0
        while pivot > 0.0 and k < len(beside):
            pivot = middle - own[k + 1] - beside[k] ** 2 / pivot
            k += 1
        low, high = (low, middle) if pivot > 0.0 else (middle, high)
    return float(high)


@compiled
def chained(variance: Floats, own: Floats, beside: Floats, pull2: float) -> Floats:
    """Log-likelihood of noise of each variance in the modes of a chain.

    Parameters
    ----------
    variance : ndarray, shape (v,)
        In units of that of the modes (1).
    own : ndarray, shape (m,)
    beside : ndarray, shape (m - 1,)
        As `Tridiagonal` has them (1).
    pull2 : float
        Square of the information vector (1).

    Returns
    -------
    ndarray, shape (v,)
        ``v b'(I + vA)^-1 b / 2 - log det(I + vA) / 2`` (1).
    """
    out = np.empty(len(variance))
    last = len(own) - 1
    for k in range(len(variance)):
        v = variance[k]
        # Less than 1 is rounding: I + vA is not below the unit matrix, and so are its pivots.
        c = max(1.0 + v * own[last], 1.0)
        log_det = np.log(c)
        for i in range(last - 1, -1, -1):
            c = max(1.0 + v * own[i] - (v * beside[i]) ** 2 / c, 1.0)
            log_det += np.log(c)
        out[k] = 0.5 * (v * pull2 / c - log_det)
    return out
