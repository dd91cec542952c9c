"""Effects that the data cannot tell apart, and by how much a covariance tells them apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats


@dataclass(frozen=True)
class OpenClass:
    """An effect that was found, and those that the data cannot tell from it."""

    found: str
    """Label."""
    alike: tuple[str, ...]
    """Length k. Labels; the nearest first."""
    columns: tuple[int, ...]
    """Length k + 1. Parameters of `SoFar`: that of `found`, then those of `alike`."""
    size: Floats
    """Estimate of each by itself (SI), shape (k + 1,)."""
    needed: Floats
    """Difference of log Bayes factors (1) that is lacking before `found` is told from each, shape (k,)."""


def separation(one: OpenClass, prior: Floats, covariance: Floats) -> Floats:
    """Half the square of the significance by which each look-alike differs from what was found.

    Parameters
    ----------
    one : OpenClass
        With a look-alikes.
    prior : ndarray, shape (p,)
        One-sigma of the parameters that the covariance starts from (SI).
    covariance : ndarray, shape (k, p, p)
        SI.

    Returns
    -------
    ndarray, shape (k, a)
        Mean difference of log-likelihoods (1), by the one of the two that shows less.
    """
    rows = np.array(one.columns)
    prior = prior[rows]
    C = covariance[:, rows][:, :, rows] / np.outer(prior, prior)
    J = np.linalg.inv(C) - np.eye(len(rows))
    size = (one.size / prior) ** 2
    own = np.maximum(np.diagonal(J, axis1=1, axis2=2), 1e-12)
    across = J[:, 0, 1:] ** 2
    first = size[0] * (own[:, :1] - across / own[:, 1:])
    other = size[1:] * (own[:, 1:] - across / own[:, :1])
    return np.asarray(0.5 * np.maximum(np.minimum(first, other), 0.0))
