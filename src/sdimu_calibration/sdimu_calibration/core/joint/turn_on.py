"""How far coefficients differ from power-on to power-on: sigma by restricted likelihood, with its 95 % interval.

The interval holds the sigmas whose profile of the restricted log-likelihood is within 1.92 of its top (D. Hardy, S.
Thompson, "A likelihood approach to meta-analysis with random effects", Statistics in Medicine 15, 1996).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.joint.combine import Combination, JointEstimate, Line
from sdimu_calibration.core.results import TurnOn
from sdimu_calibration.core.variances import FALL, crossing

_SMALLEST, _LARGEST = 1e-3, 1e6
"""Range of the sigma over the resolution of one power-on (1): below, nothing is seen of it; no IMU is beyond."""
_AT_BOUND = 1e-3
"""Share (1) to which a bound is found, of its way from the top in log: no bound is known to a thousandth."""
_GRID = 37
"""Number of sigmas of the first look at the range: four a decade, so that no top of the likelihood lies between."""
_OPEN = 30
"""Number of sigmas over which the scatter is averaged: its likelihood is wider than three of their steps."""
_WIDEST = 3.0
"""Largest of these sigmas over the upper bound of the interval (1): beyond it the likelihood is nothing."""
_SWEEPS = 4
"""Number of times that all components are optimised in turn: they hardly depend on each other."""


def turn_on_scatter(combined: Combination) -> tuple[TurnOn, ...]:
    """Estimate the sigma of every component.

    Parameters
    ----------
    combined : Combination
        Of two power-ons at least.
    """
    scale = np.array([combined.resolution(k) for k in range(len(combined.components))])
    tau = np.where(np.isfinite(scale), scale, 0.0)
    for _ in range(_SWEEPS if len(tau) > 1 else 1):
        for k in range(len(tau)):
            tau[k] = _best(combined.along(k, tau), scale[k])
    return tuple(_with_interval(combined, tau, k, scale[k]) for k in range(len(tau)))


def in_scatter(combined: Combination, found: Sequence[TurnOn]) -> JointEstimate:
    """Estimate all parameters, their sigmas with what is not known of the scatter.

    With few power-ons the scatter is known to a factor: values and covariance are the mean over the sigmas that the
    data leave open, each weighed with its likelihood (flat prior of sigma: A. Gelman, "Prior distributions for variance
    parameters in hierarchical models", Bayesian Analysis 1, 2006).
    """
    tau = np.array([t.sigma for t in found])
    best = combined.estimate(tau)
    more, spread = np.zeros_like(best.covariance), best.deviation_sigma**2
    for k, one in enumerate(found):
        grid, weight = _open_sigmas(combined, tau, k, one)
        each = [combined.estimate(_with(tau, k, size)) for size in grid]
        mean = sum(w * e.values for w, e in zip(weight, each, strict=True))
        more += sum(
            w * (e.covariance - best.covariance + np.outer(e.values - mean, e.values - mean))
            for w, e in zip(weight, each, strict=True)
        )
        middle = sum(w * e.deviation for w, e in zip(weight, each, strict=True))
        spread = (
            spread
            - best.deviation_sigma**2
            + sum(w * (e.deviation_sigma**2 + (e.deviation - middle) ** 2) for w, e in zip(weight, each, strict=True))
        )
    return replace(best, covariance=best.covariance + more, deviation_sigma=np.sqrt(spread))


def _open_sigmas(combined: Combination, tau: Floats, k: int, found: TurnOn) -> tuple[Floats, Floats]:
    """Sigmas (SI) of one component that the data leave open, and the weight of each."""
    if not np.isfinite(found.high):
        return tau[k : k + 1], np.ones(1)
    grid = (np.arange(_OPEN) + 0.5) * _WIDEST * found.high / _OPEN
    line = combined.along(k, tau)
    likelihood = np.array([line.log_likelihood(size) for size in grid.tolist()])
    weight = np.exp(likelihood - likelihood.max())
    return grid, weight / weight.sum()


def _with(tau: Floats, k: int, size: float) -> Floats:
    trial = tau.copy()
    trial[k] = size
    return trial


def _best(line: Line, scale: float) -> float:
    """Sigma (SI) of one component that the others leave most likely; 0 where none is likelier."""
    from scipy.optimize import minimize_scalar  # noqa: PLC0415 (0.2 s that a single recording does not need)

    if not np.isfinite(scale):
        return 0.0
    grid = np.log(scale * np.geomspace(_SMALLEST, _LARGEST, _GRID))
    values = [line.log_likelihood(float(np.exp(x))) for x in grid]
    top = int(np.argmax(values))
    if top == 0:
        return 0.0
    found = minimize_scalar(
        lambda x: -line.log_likelihood(float(np.exp(x))),
        bounds=(grid[top - 1], grid[min(top + 1, _GRID - 1)]),
        method="bounded",
        options={"xatol": 1e-3},
    )
    return float(np.exp(found.x)) if -found.fun > line.log_likelihood(0.0) else 0.0


def _with_interval(combined: Combination, tau: Floats, k: int, scale: float) -> TurnOn:
    effect = combined.components[k].effect
    if not np.isfinite(scale):
        return TurnOn(effect, 0.0, 0.0, float("inf"), len(combined.y))
    line = combined.along(k, tau)
    limit = line.log_likelihood(float(tau[k])) - FALL

    def above(x: float) -> float:
        return line.log_likelihood(float(np.exp(x))) - limit

    bottom, end = np.log(scale * _SMALLEST), np.log(scale * _LARGEST)
    begin, low, high = max(np.log(tau[k]), bottom) if tau[k] > 0.0 else bottom, 0.0, float("inf")
    if begin > bottom and above(bottom) < 0.0:
        low = float(np.exp(begin - crossing(lambda way: above(begin - way), 1.0, _AT_BOUND)))
    if above(end) < 0.0:
        high = float(np.exp(begin + crossing(lambda way: above(begin + way), 1.0, _AT_BOUND)))
    return TurnOn(effect, float(tau[k]), low, high, len(combined.y))
