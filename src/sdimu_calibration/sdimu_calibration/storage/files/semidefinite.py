"""Whether numbers of a file are a covariance, or information: none is below zero along any direction."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats


def is_semidefinite(matrix: Floats, slack: float) -> bool:
    """Whether a matrix is symmetric and positive semidefinite, but for rounding.

    Parameters
    ----------
    matrix : ndarray, shape (k, k)
        Finite, in any units; its diagonal is not below zero.
    slack : float
        By how much an element may be wrong, as a share of the root of the product of its two diagonal elements (1).
    """
    size = np.sqrt(np.diag(matrix))
    scale = np.divide(1.0, size, out=np.zeros(len(size)), where=size > 0.0)
    shares = scale[:, None] * matrix * scale
    least = float(np.linalg.eigvalsh(shares).min(initial=0.0))
    return bool((np.abs(shares - shares.T) <= slack).all() and least >= -slack * max(1, len(size)))
