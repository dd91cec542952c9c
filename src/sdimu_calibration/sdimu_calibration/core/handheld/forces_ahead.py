"""Forces of the rests of a run by hand, each predicted from everything but itself."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sdimu_calibration.core.arrays import Floats


class ForcesAhead(NamedTuple):
    """Prediction errors."""

    rms: float
    """Over the sigmas of the fit, correlations of the axes of a rest included (1)."""
    error: Floats
    sigma: Floats
    """`error`, `sigma`: measured less predicted, and what it scatters by with the noise of the fit (m/s^2),
    shape (k, 3)."""


def forces_ahead(Q: Floats, white: Floats, sigma: Floats, k: int) -> ForcesAhead:
    """Predict the force at each rest without it.

    Leaving rows out of a least squares needs no new fit: with H their part of the hat matrix the prediction error is
    ``(I - H)^-1 e`` with covariance ``(I - H)^-1`` (Belsley, Kuh & Welsch, *Regression Diagnostics*, section 2.1).

    Parameters
    ----------
    Q : ndarray, shape (m, u)
        Orthogonal factor of the whitened equations, those of the k rests first: rates, then forces of each.
    white : ndarray, shape (m,)
        Whitened residuals.
    sigma : ndarray, shape (m,)
        Of the equations (SI).
    """
    total, error, scatter = 0.0, np.zeros((k, 3)), np.zeros((k, 3))
    for i in range(k):
        at = slice(6 * i + 3, 6 * i + 6)
        inverse = _inverse(np.eye(3) - Q[at] @ Q[at].T)
        ahead = inverse @ white[at]
        total += float(white[at] @ ahead)
        error[i], scatter[i] = sigma[at] * ahead, sigma[at] * np.sqrt(np.diag(inverse))
    return ForcesAhead(float(np.sqrt(total / (3 * k))), error, scatter)


def _inverse(rest: Floats) -> Floats:
    """Invert ``I - H``, shape (3, 3), where a rest alone may tell a coefficient: what is left of it is rounding."""
    size, axes = np.linalg.eigh(rest)
    return np.asarray((axes / np.maximum(size, _LEAST_LEFT)) @ axes.T)


_LEAST_LEFT = 1e-12
"""Least share of a force (1) that the others do not predict: below it is the rounding of the factor."""
