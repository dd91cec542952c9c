"""Means of noise with a memory over the rests so far, as states that a pass carries along."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.compiled import compiled


def share_of_rests(start: Floats, end: Floats, dwell: Bools) -> Floats:
    """Tell how much of all rests so far each epoch at rest is, itself among them.

    Parameters
    ----------
    start, end : ndarray, shape (e,)
        Of each epoch (s), from the start of the test on.
    dwell : ndarray of bool, shape (e,)

    Returns
    -------
    ndarray, shape (e,)
        0 of an epoch that is not at rest (1).
    """
    rested = np.where(dwell, end - start, 0.0)
    return np.asarray(rested / np.maximum(np.cumsum(rested), np.finfo(float).tiny))


@compiled
def into_means(share: float, averaged: Ints, first: int, x: Floats, P: Floats, used: Floats) -> None:
    """Take the noise at the end of an epoch at rest into its means, in place.

    Parameters
    ----------
    share : float
        Length of the epoch over that of all rests so far, itself among them (1).
    averaged : ndarray of int, shape (w, 2)
        Place of a state of noise among the coefficients, and of the mean that it belongs to; mean by mean.
    first : int
        Number of states before the coefficients.
    x, P : ndarray, shape (s,) and (s, s)
        Mean and covariance of a filter's state (SI).
    used : ndarray, shape (p,)
        Coefficients in the compensation (SI).
    """
    s = x.shape[0]
    for k in range(averaged.shape[0]):
        noise, mean = averaged[k, 0], averaged[k, 1]
        i, j = first + mean, first + noise
        left = 1.0 - share if k == 0 or averaged[k - 1, 1] != mean else 1.0
        used[mean] = left * used[mean] + share * used[noise]
        x[i] = left * x[i] + share * x[j]
        for c in range(s):
            P[i, c] = left * P[i, c] + share * P[j, c]
    for r in range(s):
        for k in range(averaged.shape[0]):
            i, j = first + averaged[k, 1], first + averaged[k, 0]
            left = 1.0 - share if k == 0 or averaged[k - 1, 1] != averaged[k, 1] else 1.0
            P[r, i] = left * P[r, i] + share * P[r, j]
