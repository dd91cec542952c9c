"""What a plan tells beyond what is known already.

A plan is judged by the information of perfect data (`bound.bounds`). What earlier data know is information on the same
coefficients, and the two add up: J = J_known + J_plan. A coefficient that is another one in the next recording (a bias
after switching on again) has there the value of the unit plus a deviation ``N(0, tau^2)``; the deviation is eliminated
from J_plan, ``J - J L (I + L' J L)^-1 L' J`` with L = diag(tau).

The gain of data is half the logarithm of the ratio of the determinants of the covariance before and after it: the
Shannon information that a Bayesian expects of them (D. Lindley, *Ann. Math. Stat.* 27 (1956); K. Chaloner &
I. Verdinelli, *Statistical Science* 10 (1995)). What nothing so far tells apart has a wide covariance along its
difference, so that a plan which tells it apart gains most.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.evidence.known import Known, data_information


def together(known: Known | None, names: Sequence[str], prior: Floats, plan: Floats | None) -> Floats:
    """Covariance of the coefficients of the unit after a plan (SI), earlier data counted, shape (p, p).

    Parameters
    ----------
    known : Known or None
        None: nothing but the prior.
    names : sequence of str, length p
    prior : ndarray, shape (p,)
        Sigma of each before all data (SI).
    plan : ndarray, shape (p, p), or None
        Covariance that the data of the plan alone leave of the prior (SI); None: before it is run.
    """
    p = len(prior)
    J = np.eye(p) if known is None else np.eye(p) + known.of(names, prior)
    if plan is not None:
        told = data_information(plan, prior)
        L = np.zeros(p) if known is None else known.anew(names) / prior
        varies = np.flatnonzero(L > 0.0)
        if len(varies):
            across = told[:, varies] * L[varies]
            own = np.eye(len(varies)) + told[np.ix_(varies, varies)] * np.outer(L[varies], L[varies])
            told = told - across @ np.linalg.solve(own, across.T)
        J = J + told
    covariance = np.linalg.inv(0.5 * (J + J.T))
    return np.asarray(0.5 * (covariance + covariance.T) * np.outer(prior, prior))


def gain(before: Floats, after: Floats) -> float:
    """Information that data add (nat): half the logarithm of the ratio of the determinants.

    Parameters
    ----------
    before, after : ndarray, shape (p, p)
        Covariances of the same coefficients (SI).
    """
    unit = 1.0 / np.sqrt(np.diag(before))
    scaled = (np.linalg.slogdet(C * np.outer(unit, unit))[1] for C in (before, after))
    return 0.5 * float(next(scaled) - next(scaled))
