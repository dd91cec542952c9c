"""A variance between values of known errors: restricted maximum likelihood, with an interval.

Model: ``y_i = mean of the group of i + slope x_i + u_i + e_i``, ``u ~ N(0, tau^2)``, ``e_i ~ N(0, s_i^2)``, all s_i
known (random-effects meta-analysis). tau^2 maximises the restricted likelihood (Harville, JASA 72, 1977). Its interval
is the Q-profile (Viechtbauer, Statistics in Medicine 26, 2007): the weighted sum of squares at the true tau^2 is chi2
with n - groups degrees of freedom, exactly. Means and slopes have the variance of Hartung & Knapp (Statistics in
Medicine 20, 2001) and Student's t.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.probability import chi2_limit, chi2_tail, student_limit, student_tail
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.variances import crossing

LEVEL = 0.95
"""Probability of all intervals: what data sheets and the reports here use."""
_GRID = 41
"""Number of variances that are tried at once: the likelihood is smooth in the logarithm of the variance."""
_ZOOMS = 4
"""Number of times that the grid narrows about the best: each by a factor of 20, beyond 1e-4 of the variance."""


@dataclass(frozen=True)
class RandomEffect:
    """What varies between values beyond their known errors, in the unit of the values."""

    spread: float
    """Standard deviation tau."""
    low: float
    high: float
    """`low`, `high`: its interval at `LEVEL`."""
    dof: int
    """Values less what was fitted."""
    q: float
    """Weighted sum of squares without a spread (Cochran's Q)."""
    p_value: float
    """Probability of such a Q if nothing varies."""
    mean: float
    """Weighted mean of the first group, at x = 0."""
    mean_sigma: float
    """Its standard error."""
    slope: float = math.nan
    slope_sigma: float = math.nan
    """`slope`, `slope_sigma`: change of the values by unit of x; NaN without x."""

    @property
    def mean_interval(self) -> tuple[float, float]:
        """Interval of the mean at `LEVEL`."""
        half = student_limit(0.5 * (1.0 - LEVEL), self.dof) * self.mean_sigma
        return self.mean - half, self.mean + half

    @property
    def slope_p(self) -> float:
        """Probability of a slope of at least this size if there is none; 1 without one."""
        if not self.slope_sigma > 0.0:
            return 1.0
        return 2.0 * student_tail(abs(self.slope) / self.slope_sigma, self.dof)


class _Fitted(NamedTuple):
    """Fit at each of k variances; the variances of mean (of the first group) and slope are inverse weights."""

    likelihood: Floats
    q: Floats
    mean: Floats
    slope: Floats
    mean_variance: Floats
    slope_variance: Floats


def random_effect(
    values: Floats, sigmas: Floats, groups: Sequence[str] | None = None, x: Floats | None = None
) -> RandomEffect:
    """Estimate what varies between values beyond their errors.

    Parameters
    ----------
    values, sigmas : ndarray, shape (n,)
        Measured values and their standard deviations, in one unit.
    groups : sequence of str, optional
        Each group has a mean of its own; None for one group.
    x : ndarray, shape (n,), optional
        Regressor of a slope that all groups share (dimensionless, or its own unit).
    """
    problem = _problem(values, sigmas, groups, x)
    fit, unit, dof, tau2 = problem.fit, problem.unit, problem.dof, problem.tau2
    found, none = fit(np.array([tau2])), fit(np.zeros(1))
    low, high = (problem.crossing(chi2_limit(p, dof)) for p in (0.5 * (1.0 - LEVEL), 0.5 * (1.0 + LEVEL)))
    scale = float(found.q[0]) / dof
    return RandomEffect(
        spread=unit * math.sqrt(tau2),
        low=unit * math.sqrt(low),
        high=unit * math.sqrt(max(high, tau2)),
        dof=dof,
        q=float(none.q[0]),
        p_value=chi2_tail(float(none.q[0]), dof),
        mean=unit * float(found.mean[0]),
        mean_sigma=unit * math.sqrt(scale * float(found.mean_variance[0])),
        slope=unit * float(found.slope[0]),
        slope_sigma=unit * math.sqrt(scale * float(found.slope_variance[0])),
    )


def spread_and_mean(values: Floats, sigmas: Floats) -> tuple[float, float]:
    """Spread and weighted mean of one group, without intervals, for less.

    Parameters
    ----------
    values, sigmas : ndarray, shape (n,)
        As for `random_effect`, in one unit.
    """
    problem = _problem(values, sigmas, None, None)
    mean = float(problem.fit(np.array([problem.tau2])).mean[0])
    return problem.unit * math.sqrt(problem.tau2), problem.unit * mean


class _Problem(NamedTuple):
    """Fit as a function of the variance, in a unit of its own, and the variance of the highest likelihood."""

    fit: Callable[[Floats], _Fitted]
    unit: float
    dof: int
    tau2: float

    def crossing(self, target: float) -> float:
        """Find the variance at which the sum of squares is `target`; 0 where it is below at once."""
        return crossing(lambda tau2: float(self.fit(np.array([tau2])).q[0]) - target, 1.0)


def _problem(values: Floats, sigmas: Floats, groups: Sequence[str] | None, x: Floats | None) -> _Problem:
    if not np.isfinite(values).all() or not (np.isfinite(sigmas) & (sigmas > 0.0)).all():
        raise DataError("values of several results: every value and every sigma must be a number, sigma above zero")
    labels = np.zeros(len(values), dtype=np.int64) if groups is None else np.unique(groups, return_inverse=True)[1]
    number = int(labels.max()) + 1
    dof = len(values) - number - (x is not None)
    if dof < 1:
        raise DataError(f"{len(values)} values in {number} groups: a spread needs two values in a group at least")
    # In units of their own size: SI values of an IMU are down to 1e-9.
    unit = float(np.sqrt(np.median(sigmas**2) + np.var(values)))
    member = np.equal.outer(labels, np.arange(number)).astype(float)
    fit = partial(_fit, values=values / unit, errors=(sigmas / unit) ** 2, member=member, x=x)
    tau2 = best_variance(lambda tau2: fit(tau2).likelihood, float(np.ptp(values / unit)) ** 2)
    return _Problem(fit, unit, dof, tau2)


def _fit(tau2: Floats, values: Floats, errors: Floats, member: Floats, x: Floats | None) -> _Fitted:
    """Fit means and slope at variances (k,)."""
    w = 1.0 / (tau2[:, None] + errors)
    total = w @ member
    mean = (w * values) @ member / total
    left = values - mean @ member.T
    logdet = np.log(total).sum(axis=1)
    first, slope, slope_variance = mean[:, 0], np.full(len(tau2), math.nan), np.full(len(tau2), math.nan)
    mean_variance = 1.0 / total[:, 0]
    if x is not None:
        middle = (w * x) @ member / total
        own = x - middle @ member.T
        power = (w * own**2).sum(axis=1)
        slope, slope_variance = (w * own * left).sum(axis=1) / power, 1.0 / power
        left = left - slope[:, None] * own
        logdet = logdet + np.log(power)
        first = first - slope * middle[:, 0]
        mean_variance = mean_variance + middle[:, 0] ** 2 / power
    q = (w * left**2).sum(axis=1)
    likelihood = 0.5 * (np.log(w).sum(axis=1) - logdet - q)
    return _Fitted(likelihood, q, first, slope, mean_variance, slope_variance)


def best_variance(likelihood: Callable[[Floats], Floats], largest: float) -> float:
    """Find the variance of the highest likelihood: a grid that narrows.

    Parameters
    ----------
    likelihood : callable
        Of variances, shape (k,), in the unit of `largest`; one value each, shape (k,).
    largest : float
        No variance is much larger.
    """
    if not largest > 0.0:
        return 0.0
    grid = np.concatenate([[0.0], np.geomspace(1e-10 * largest, 4.0 * largest, _GRID)])
    for _ in range(_ZOOMS):
        k = int(np.argmax(likelihood(grid)))
        if k == 0:
            return 0.0
        low, high = grid[max(k - 1, 1)], grid[min(k + 1, len(grid) - 1)]
        grid = np.concatenate([[0.0], np.geomspace(low, high, _GRID)])
    return float(grid[int(np.argmax(likelihood(grid)))])
