"""Does a model predict stops that it has not seen? Leave one stop out, turn before it included.

The coefficients are fitted on the innovations of all other stops; those of the stop left out are predicted with the
uncertainty of the fit. In-sample chi-square falls with every parameter; this does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.evidence.in_stops import InStops
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.lean import lean

with lean():
    from scipy.linalg import lapack, solve_triangular

_LEAST_LEFT = 1e-6
"""Share (1) of a direction that its own fit must leave for the prediction without it to be worked out of that fit: a
smaller difference of nearly equal numbers has less than nine digits."""


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
    # Noise with a memory is predicted like a parameter of unit variance: what a stop shares with its neighbours.
    noise = InStops.none(evidence.stop) if evidence.noise is None else evidence.noise
    r = noise.parts.shape[1]
    columns = noise.beside(evidence.W[:, chosen])
    normal = _Normal.of(columns, evidence.e, np.append(np.ones(r), weight), np.append(np.zeros(r), shift))
    score = np.zeros(len(columns.stops))
    total, count = 0.0, 0
    for k in range(len(score)):
        error, score[k], spread = normal.without(k)
        told = spread < evidence.unpredictable
        total += float(np.sum(error[told] ** 2 / spread[told]))
        count += int(told.sum())
    return HeldOut(columns.stops, score, float(np.sqrt(total / max(count, 1))))


@dataclass(frozen=True)
class _Normal:
    """Normal equations of c parameters on all N rows, and what the rows of a stop are predicted to be without them.

    A stop is predicted in its directions; the rest of its rows tells of no parameter, and none tells of it.
    """

    columns: InStops
    seen: Floats
    """What the residuals have of the directions, shape (M,)."""
    rest: Floats
    """What they have beside them, shape (N,)."""
    weight: Floats
    shift: Floats

    @classmethod
    def of(cls, columns: InStops, e: Floats, weight: Floats, shift: Floats) -> _Normal:
        """Take the residuals apart."""
        seen = columns.seen(e[:, None])[:, 0]
        return cls(columns, seen, e - columns.spread(seen), weight, shift)

    @cached_property
    def d(self) -> Floats:
        """Information vector of all rows, with the pull of the prior means, shape (c,)."""
        return np.asarray(self.columns.parts.T @ self.seen + self.weight * self.shift)

    @cached_property
    def of_fit(self) -> tuple[Floats, Floats]:
        """``X`` with ``X X'`` the part of each direction in the fit of all (M, c), and what the fit leaves (M,)."""
        A = self.columns.square + np.diag(self.weight)
        unit = 1.0 / np.sqrt(np.diag(A))
        L = np.linalg.cholesky(A * np.outer(unit, unit))
        every = np.column_stack([self.columns.parts.T * unit[:, None], self.d * unit])
        X = solve_triangular(L, every, lower=True, check_finite=False, overwrite_b=True).T
        return X[:-1], self.seen - X[:-1] @ X[-1]

    def without(self, k: int) -> tuple[Floats, float, Floats]:
        """Predict the k-th stop, of n rows, from all others.

        Returns
        -------
        error : ndarray, shape (n,)
        log_score : float
        spread : ndarray, shape (n,)
            Variance of each error.
        """
        Q, rest = self.columns.directions[k], self.rest[self.columns.rows[k]]
        if not Q.size:
            return rest, -0.5 * float(rest @ rest), np.ones(len(rest))
        error, score, root = self._of_fit_to_all(k) or self._anew(k)
        # Beside its directions a row has the unit variance of white noise.
        spread = 1.0 - np.sum(Q**2, axis=1) + np.sum((Q @ root) ** 2, axis=1)
        return rest + Q @ error, score - 0.5 * float(rest @ rest), spread

    def _of_fit_to_all(self, k: int) -> tuple[Floats, float, Floats] | None:
        """Predict the m directions of a stop from the fit to all rows; None where hardly anything else tells of one.

        With H the part of the directions in their own fit, the error is ``(I - H)^-1`` times what the fit leaves, and
        its covariance ``(I - H)^-1``. Source: R. D. Cook, S. Weisberg, "Residuals and influence in regression" (1982),
        2.2.

        Returns
        -------
        error : ndarray, shape (m,)
        log_score : float
        root : ndarray, shape (m, m)
            Of the covariance of the error.
        """
        place = self.columns.places[k]
        X, error = self.of_fit[0][place], self.of_fit[1][place]
        left = np.eye(len(X)) - X @ X.T
        L, failed = lapack.dpotrf(left, lower=1)
        if failed:
            return None
        root, _ = lapack.dtrtri(L, lower=1)
        # The sum of all inverse eigenvalues is at least the largest of them.
        if _LEAST_LEFT * float(np.sum(root**2)) > 1.0 and np.linalg.eigvalsh(left)[0] < _LEAST_LEFT:
            return None
        white = root @ error
        return white @ root, -0.5 * float(white @ white) + float(np.log(np.diag(L)).sum()), root.T

    def _anew(self, k: int) -> tuple[Floats, float, Floats]:
        """Predict the directions of a stop from the fit to the other rows, with the returns of `_of_fit_to_all`."""
        place, every = self.columns.places[k], self.columns.parts
        W, e = every[place], self.seen[place]
        unit = 1.0 / np.sqrt(np.diag(self.columns.square) + self.weight)
        A = self.columns.square - W.T @ W + np.diag(self.weight)
        inverse = np.linalg.inv(A * np.outer(unit, unit)) * np.outer(unit, unit)
        error = e - W @ (inverse @ (self.d - W.T @ e))
        X = W @ np.linalg.cholesky(0.5 * (inverse + inverse.T) + 1e-18 * np.diag(np.diag(inverse)))
        # Not of I + XX' itself: what one of its directions is without all others is lost beside the largest.
        root = np.linalg.qr(np.vstack([np.eye(len(e)), X.T]))[1].T
        white = np.linalg.solve(root, error)
        return error, -0.5 * float(white @ white) - float(np.log(np.abs(np.diag(root))).sum()), np.asarray(root)


def gain(before: HeldOut, after: HeldOut, apart: int | None = None) -> tuple[float, float]:
    """Gain of the log score and its standard error over stops (paired differences), the stop `apart` left out."""
    difference = (after.log_score - before.log_score)[before.stop != (-1 if apart is None else apart)]
    return float(difference.sum()), float(np.std(difference, ddof=1) * np.sqrt(len(difference)))
