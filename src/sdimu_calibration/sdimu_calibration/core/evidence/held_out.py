"""Does a model predict stops that it has not seen? Leave one stop out, turn before it included.

The coefficients are fitted on the innovations of all other stops; those of the stop left out are predicted with the
uncertainty of the fit. In-sample chi-square falls with every parameter; this does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.lean import lean

with lean():
    from scipy.linalg import lapack, solve_triangular

_LEAST_LEFT = 1e-6
"""Share (1) of a row that its own fit must leave for the prediction without it to be worked out of that fit: below, a
difference of nearly equal numbers has less than nine digits."""


@dataclass(frozen=True)
class HeldOut:
    """Prediction of every stop from the others."""

    stop: Ints
    """Shape (s,)."""
    log_score: Floats
    """Log predictive density of each stop, shape (s,)."""
    rms: float
    """Of the normalised prediction errors of all stops; of rows that can be predicted at all."""


def predict(evidence: LinearEvidence, chosen: Ints, weight: Floats, shift: Floats) -> HeldOut:
    """Leave one stop out.

    Parameters
    ----------
    chosen : ndarray of int, shape (k,)
        Parameters of the model under test.
    weight, shift : ndarray, shape (k,)
        Prior information and prior mean of each, about the calibration's values.
    """
    W, e = evidence.W[:, chosen], evidence.e
    if evidence.noise.size:
        # Noise with a memory is predicted like a parameter of unit variance: what a stop shares with its neighbours.
        W, r = np.hstack([W, evidence.noise]), evidence.noise.shape[1]
        weight, shift = np.append(weight, np.ones(r)), np.append(shift, np.zeros(r))
    normal = _Normal(W, e, weight, shift)
    stops = np.unique(evidence.stop)
    score = np.zeros(len(stops))
    total, count = 0.0, 0
    for k, stop in enumerate(stops):
        rows = evidence.stop == stop
        error, score[k], spread = normal.without(rows)
        told = spread < evidence.unpredictable
        total += float(np.sum(error[told] ** 2 / spread[told]))
        count += int(told.sum())
    return HeldOut(stops.astype(np.int64), score, float(np.sqrt(total / max(count, 1))))


@dataclass(frozen=True)
class _Normal:
    """Normal equations of k parameters on all N rows, and what a part of the rows is predicted to be without it."""

    W: Floats
    e: Floats
    weight: Floats
    shift: Floats

    @cached_property
    def J(self) -> Floats:
        """Information of all rows, shape (k, k)."""
        return np.asarray(self.W.T @ self.W)

    @cached_property
    def d(self) -> Floats:
        """Its vector with the pull of the prior means, shape (k,)."""
        return np.asarray(self.W.T @ self.e + self.weight * self.shift)

    @cached_property
    def of_fit(self) -> tuple[Floats, Floats]:
        """``X`` with ``X X'`` the part of each row in the fit of all (N, k), and what the fit leaves (N,)."""
        A = self.J + np.diag(self.weight)
        unit = 1.0 / np.sqrt(np.diag(A))
        L = np.linalg.cholesky(A * np.outer(unit, unit))
        every = np.column_stack([self.W.T * unit[:, None], self.d * unit])
        X = solve_triangular(L, every, lower=True, check_finite=False, overwrite_b=True).T
        return X[:-1], self.e - X[:-1] @ X[-1]

    def without(self, rows: Bools) -> tuple[Floats, float, Floats]:
        """Predict rows from all others.

        Parameters
        ----------
        rows : ndarray of bool, shape (N,)
            n of them.

        Returns
        -------
        error : ndarray, shape (n,)
        log_score : float
        spread : ndarray, shape (n,)
            Variance of each error.
        """
        few = np.count_nonzero(rows) < len(self.weight)
        told = self._by_rows(rows) if few else self._by_parameters(rows)
        return self._anew(self.W[rows], self.e[rows]) if told is None else told

    def _by_rows(self, rows: Bools) -> tuple[Floats, float, Floats] | None:
        """Work in the number of rows, from the fit to all of them; None where hardly anything else tells of a row.

        With H the part of the rows in their own fit, the error is ``(I - H)^-1`` times what the fit leaves, and its
        covariance ``(I - H)^-1``. Source: R. D. Cook, S. Weisberg, "Residuals and influence in regression" (1982), 2.2.
        """
        X, error = self.of_fit[0][rows], self.of_fit[1][rows]
        left = np.eye(len(X)) - X @ X.T
        L, failed = lapack.dpotrf(left, lower=1)
        if failed:
            return None
        root, _ = lapack.dtrtri(L, lower=1)
        spread = np.einsum("ij,ij->j", root, root)
        # The sum of all inverse eigenvalues is at least the largest of them.
        if _LEAST_LEFT * spread.sum() > 1.0 and np.linalg.eigvalsh(left)[0] < _LEAST_LEFT:
            return None
        white = root @ error
        log_score = -0.5 * float(white @ white) + float(np.log(np.diag(L)).sum())
        return white @ root, log_score, spread

    def _by_parameters(self, rows: Bools) -> tuple[Floats, float, Floats] | None:
        """Work in the number of parameters k, from the fit to all rows; None as of `_by_rows`.

        ``(I - X X')^-1 = I + X (I - X'X)^-1 X'`` with the same determinant: ``I - X'X`` has the size k.
        """
        X, error = self.of_fit[0][rows], self.of_fit[1][rows]
        left = np.eye(X.shape[1]) - X.T @ X
        L, failed = lapack.dpotrf(left, lower=1)
        if failed:
            return None
        Y = solve_triangular(L, X.T, lower=True, check_finite=False)
        spread = 1.0 + np.einsum("ij,ij->j", Y, Y)
        if _LEAST_LEFT * spread.sum() > 1.0 and np.linalg.eigvalsh(left)[0] < _LEAST_LEFT:
            return None
        white = Y @ error
        log_score = -0.5 * float(error @ error + white @ white) + float(np.log(np.diag(L)).sum())
        return error + white @ Y, log_score, spread

    def _anew(self, W: Floats, e: Floats) -> tuple[Floats, float, Floats]:
        """Work in the number of parameters, from the fit to the other rows.

        The log of N(error; 0, I + W A^-1 W') by the matrix inversion lemma.
        """
        unit = 1.0 / np.sqrt(np.diag(self.J) + self.weight)
        A = self.J - W.T @ W + np.diag(self.weight)
        inverse = np.linalg.inv(A * np.outer(unit, unit)) * np.outer(unit, unit)
        error = e - W @ (inverse @ (self.d - W.T @ e))
        root = np.linalg.cholesky(0.5 * (inverse + inverse.T) + 1e-18 * np.diag(np.diag(inverse)))
        X = W @ root
        M = np.eye(len(self.weight)) + X.T @ X
        y = X.T @ error
        chi2 = error @ error - y @ np.linalg.solve(M, y)
        return error, -0.5 * float(chi2 + np.linalg.slogdet(M)[1]), 1.0 + np.sum(X**2, axis=1)


def gain(before: HeldOut, after: HeldOut, apart: int | None = None) -> tuple[float, float]:
    """Gain of the log score and its standard error over stops (paired differences), the stop `apart` left out."""
    difference = (after.log_score - before.log_score)[before.stop != (-1 if apart is None else apart)]
    return float(difference.sum()), float(np.std(difference, ddof=1) * np.sqrt(len(difference)))
