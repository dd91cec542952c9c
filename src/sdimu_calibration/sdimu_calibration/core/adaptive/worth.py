"""What a covariance is worth to a test, in nat: how much is lacking to its limits, and to telling a class apart.

Both count log-likelihood. A coefficient lacks ``log(sigma / limit)``: the Shannon information that brings its sigma to
the limit. A class lacks what the difference of log Bayes factors is short of; a move adds to it, on average,

    min_i (theta_i^2 (J_ii - J_ij^2 / J_jj)) / 2,

the part of the effect's information that the other cannot replace, J being that of the two given all else
(T-optimality: A. Atkinson & V. Fedorov, *Biometrika* 62 (1975)).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.adaptive.goals import Goals
from sdimu_calibration.core.adaptive.knowledge import Knowledge, ratios
from sdimu_calibration.core.adaptive.open_class import separation
from sdimu_calibration.core.arrays import Bools, Floats


@dataclass(frozen=True)
class Worth:
    """What is lacking after each of k covariances."""

    ratio: Floats
    """Sigma over limit, shape (k, c)."""
    apart: Floats
    """Difference of log Bayes factors that was added between the members of the open class (1), shape (k, a)."""
    lacking: Floats
    """To all limits and to telling the class apart (nat), shape (k,)."""

    @property
    def beyond(self) -> Floats:
        """What is lacking to the limits alone (nat), shape (k,)."""
        return np.asarray(np.log(np.maximum(self.ratio, 1.0)).sum(axis=1))

    def reached(self, needed: Floats) -> Bools:
        """Say which covariances leave nothing lacking, shape (k,).

        Parameters
        ----------
        needed : ndarray, shape (a,)
            Difference of log Bayes factors that is lacking, as of `OpenClass` (1).
        """
        return np.asarray((self.ratio <= 1.0).all(axis=1) & (self.apart >= needed).all(axis=1))


def worth(known: Knowledge, goals: Goals, covariance: Floats, since: Floats) -> Worth:
    """Count what is lacking.

    Parameters
    ----------
    covariance : ndarray, shape (k, p, p)
        After moves (SI).
    since : ndarray, shape (p, p)
        At the stop at which `known` was taken (SI): what was recorded there has told its part.
    """
    ratio = ratios(known.at, goals, covariance) * known.noise
    lacking = np.log(np.maximum(ratio, 1.0)).sum(axis=1)
    if known.open is None:
        return Worth(ratio, np.zeros((len(ratio), 0)), lacking)
    prior = known.at.setup.sensors.prior
    apart = separation(known.open, prior, covariance) - separation(known.open, prior, since[None])
    return Worth(ratio, apart, lacking + np.maximum(known.open.needed - apart, 0.0).sum(axis=1))
