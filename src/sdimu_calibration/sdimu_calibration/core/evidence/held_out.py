"""Does a model predict stops that it has not seen? Leave one stop out, turn before it included.

The coefficients are fitted on the innovations of all other stops; those of the stop left out are predicted with the
uncertainty of the fit. In-sample chi-square falls with every parameter; this does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.evidence.linear import LinearEvidence


@dataclass(frozen=True)
class HeldOut:
    """Prediction of every stop from the others.

    Attributes
    ----------
    stop : ndarray of int, shape (s,)
    log_score : ndarray, shape (s,)
        Log predictive density of each stop.
    rms : float
        Of the normalised prediction errors of all stops; of rows that can be predicted at all.
    """

    stop: Ints
    log_score: Floats
    rms: float


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
    J, d = W.T @ W, W.T @ e
    unit = 1.0 / np.sqrt(np.diag(J) + weight)
    stops = np.unique(evidence.stop)
    score = np.zeros(len(stops))
    total, count = 0.0, 0
    for k, stop in enumerate(stops):
        rows = evidence.stop == stop
        Ws, es = W[rows], e[rows]
        A = J - Ws.T @ Ws + np.diag(weight)
        b = d - Ws.T @ es + weight * shift
        inverse = np.linalg.inv(A * np.outer(unit, unit)) * np.outer(unit, unit)
        error = es - Ws @ (inverse @ b)
        # log N(error; 0, I + Ws A^-1 Ws') by the matrix inversion lemma, in the size of the model.
        root = np.linalg.cholesky(0.5 * (inverse + inverse.T) + 1e-18 * np.diag(np.diag(inverse)))
        X = Ws @ root
        M = np.eye(len(weight)) + X.T @ X
        y = X.T @ error
        chi2 = error @ error - y @ np.linalg.solve(M, y)
        score[k] = -0.5 * (chi2 + np.linalg.slogdet(M)[1])
        spread = 1.0 + np.sum(X**2, axis=1)
        told = spread < evidence.unpredictable
        total += float(np.sum(error[told] ** 2 / spread[told]))
        count += int(told.sum())
    return HeldOut(stops.astype(np.int64), score, float(np.sqrt(total / max(count, 1))))


def gain(before: HeldOut, after: HeldOut, apart: int | None = None) -> tuple[float, float]:
    """Gain of the log score and its standard error over stops (paired differences), the stop `apart` left out."""
    difference = (after.log_score - before.log_score)[before.stop != (-1 if apart is None else apart)]
    return float(difference.sum()), float(np.std(difference, ddof=1) * np.sqrt(len(difference)))
