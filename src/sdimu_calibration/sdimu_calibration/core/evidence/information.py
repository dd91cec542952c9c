"""Information form of linear least squares: J = W'W, d = W'e; conditioning on parameters is a Schur complement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints


@dataclass(frozen=True)
class Information:
    """What data say about parameters; whoever estimates some of them states their prior information beside it."""

    J: Floats
    """Information (inverse covariance) matrix, in inverse units (SI) of two parameters, shape (q, q)."""
    d: Floats
    """Shape (q,). Information vector, in inverse units; the estimate of parameter i alone is d_i / J_ii."""

    def given(self, known: Ints, weight: Floats) -> Information:
        """Information on all parameters when those at `known` are estimated along with them.

        With A = J[known, known] + diag(weight) and B = J[:, known] that is ``J - B A^-1 B'`` and
        ``d - B A^-1 d[known]``.

        Parameters
        ----------
        known : ndarray of int, shape (k,)
            Indices of parameters.
        weight : ndarray, shape (k,)
            Prior information of each (1/sigma^2), already in `d` where the prior mean is not zero.

        Returns
        -------
        Information
            Same size; rows of `known` are zero.
        """
        if not len(known):
            return self
        B = self.J[:, known]
        X = solved(self.J[np.ix_(known, known)] + np.diag(weight), np.column_stack([B.T, self.d[known]]))
        J = self.J - B @ X[:, :-1]
        d = self.d - B @ X[:, -1]
        J[known, :] = J[:, known] = 0.0
        d[known] = 0.0
        return Information(0.5 * (J + J.T), d)

    def diagonal_given(self, known: Ints, weight: Floats) -> tuple[Floats, Floats]:
        """Diagonal of J, and d, as `given` has them: all that a scan needs, for less.

        Parameters
        ----------
        known : ndarray of int, shape (k,)
            Indices of parameters.
        weight : ndarray, shape (k,)
            Prior information of each (1/sigma^2), as for `given`.

        Returns
        -------
        J, d : ndarray, shape (q,)
            In the units of the class; zero for the parameters at `known`.
        """
        if not len(known):
            return np.diag(self.J).copy(), self.d.copy()
        B = self.J[:, known]
        X = solved(self.J[np.ix_(known, known)] + np.diag(weight), np.column_stack([B.T, self.d[known]]))
        J = np.diag(self.J) - np.einsum("qk,kq->q", B, X[:, :-1])
        d = self.d - B @ X[:, -1]
        J[known] = d[known] = 0.0
        return J, d

    def estimate(self, chosen: Ints, weight: Floats) -> tuple[Floats, Floats]:
        """Estimate some parameters by least squares; all others are left out of the model.

        Parameters
        ----------
        chosen : ndarray of int, shape (k,)
            Indices of parameters.
        weight : ndarray, shape (k,)
            Prior information of each (1/sigma^2), as for `given`.

        Returns
        -------
        estimate : ndarray, shape (k,)
            SI.
        covariance : ndarray, shape (k, k)
        """
        A = self.J[np.ix_(chosen, chosen)] + np.diag(weight)
        scale = 1.0 / np.sqrt(np.diag(A))
        inverse = np.linalg.inv(A * np.outer(scale, scale)) * np.outer(scale, scale)
        return inverse @ self.d[chosen], inverse

    def log_likelihood(self, weight: Floats) -> float:
        """Log-likelihood with all parameters integrated over their priors, ``(d' A^-1 d - log |A|) / 2``.

        A is J + diag(weight). What it lacks of the whole, ``log |diag(weight)| / 2`` and the squares of the data, does
        not depend on the data's information.

        Parameters
        ----------
        weight : ndarray, shape (q,)
            Prior information of each (1/sigma^2), as for `given`.

        Returns
        -------
        float
            Minus infinity where rounding leaves A without a root.
        """
        from scipy.linalg import lapack  # noqa: PLC0415 (0.2 s that a single recording does not need)

        A = self.J + np.diag(weight)
        if not np.diag(A).min(initial=1.0) > 0.0:
            return -float("inf")
        scale = 1.0 / np.sqrt(np.diag(A))
        root, failed = lapack.dpotrf(A * np.outer(scale, scale), lower=1)
        if failed:
            return -float("inf")
        white, _ = lapack.dtrtrs(root, scale * self.d, lower=1)
        return float(0.5 * white @ white - np.log(np.diag(root)).sum() + np.log(scale).sum())


def solved(A: Floats, right: Floats) -> Floats:
    """Solve ``A X = right`` where the units of the unknowns differ by many orders.

    Parameters
    ----------
    A : ndarray, shape (k, k)
        Symmetric, with a positive diagonal; in any units.
    right : ndarray, shape (k, m)

    Returns
    -------
    ndarray, shape (k, m)
        In the units of `right` over those of A.
    """
    scale = 1.0 / np.sqrt(np.diag(A))
    return np.asarray(scale[:, None] * np.linalg.solve(A * np.outer(scale, scale), scale[:, None] * right))


def conditioned(covariance: Floats, known: Ints) -> Floats:
    """Covariance when some of the unknowns are known, ``C - C[:, known] C[known, known]^-1 C[known, :]``.

    Parameters
    ----------
    covariance : ndarray, shape (k, k)
        In any units.
    known : ndarray of int, shape (r,)
        Positive variances.

    Returns
    -------
    ndarray, shape (k, k)
        In the same units; zero in the rows and columns of what is known, to rounding.
    """
    across = covariance[:, known]
    return np.asarray(covariance - across @ solved(covariance[np.ix_(known, known)], across.T))
