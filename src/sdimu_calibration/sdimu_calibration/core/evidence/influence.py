"""Influence of each stop: how far the estimate moves when a stop is left out, in the sigmas of the estimate.

Source: Belsley, Kuh & Welsch, *Regression Diagnostics*, section 2.1 (DFBETAS), for groups of rows.
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.evidence.linear import LinearEvidence


def influence(evidence: LinearEvidence) -> tuple[Ints, Floats]:
    """Leave every stop out, the turn before it included, and see what moves.

    Parameters
    ----------
    evidence : LinearEvidence
        Of which the model's own parameters are looked at.

    Returns
    -------
    stop : ndarray of int, shape (s,)
    moved : ndarray, shape (s, c)
        Change of each of the c coefficients without the stop, in their sigmas with all stops (dimensionless).
    """
    p, c = len(evidence.weight), evidence.coefficients
    W, e = evidence.W[:, :p], evidence.e
    unit = 1.0 / np.sqrt(np.einsum("ij,ij->j", W, W) + evidence.weight)
    W, prior = W * unit, np.diag(evidence.weight * unit**2)
    J, d = W.T @ W + prior, W.T @ e + evidence.weight * unit * evidence.shift
    whole, sigma = np.linalg.solve(J, d), np.sqrt(np.diag(np.linalg.inv(J)))
    stops = np.unique(evidence.stop).astype(np.int64)
    moved = np.empty((len(stops), c))
    for k, stop in enumerate(stops):
        rows = evidence.stop == stop
        without = np.linalg.solve(J - W[rows].T @ W[rows], d - W[rows].T @ e[rows])
        moved[k] = ((without - whole) / sigma)[:c]
    return stops, moved
