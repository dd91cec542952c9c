"""Effects that are too weak in one unit and common to the type: their mean over units, or their variance, is not zero.

Each unit gives an estimate and its sigma for every candidate effect, however small. Per effect: twice the log of the
ratio of likelihoods between ``N(mean, sigma_i^2 + tau^2)`` and ``N(0, sigma_i^2)``. Without an effect it is, for many
units, chi2 with one degree of freedom or with two in equal shares, because tau cannot be below zero (Self & Liang, JASA
82, 1987); for few units it is less. Over all effects the share of false ones among those named is held (Benjamini &
Hochberg, JRSS B 57, 1995), also where effects look alike and thus depend on each other positively.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.fleet.reml import best_variance
from sdimu_calibration.core.probability import chi2_tail

FALSE_DISCOVERY = 0.05
"""Share of false effects among those named, on average (dimensionless): what the issue of a type can bear."""
FEWEST = 3
"""Number of units that have to know an effect: with fewer, mean and variance are one."""


@dataclass(frozen=True)
class CommonEffect:
    """One candidate effect over units, in its SI unit.

    Attributes
    ----------
    name : str
        Coefficient.
    units : int
        Units that know it.
    mean, mean_sigma : float
        Over units.
    spread : float
        Standard deviation between units (maximum likelihood).
    largest_z : float
        Of the units alone: largest estimate in sigmas.
    p_value : float
        If neither mean nor variance is there.
    q_value : float
        Smallest rate of false discoveries at which it is named.
    named : bool
    """

    name: str
    units: int
    mean: float
    mean_sigma: float
    spread: float
    largest_z: float
    p_value: float
    q_value: float
    named: bool


def common_effects(
    names: Sequence[str], estimates: Floats, sigmas: Floats, rate: float = FALSE_DISCOVERY
) -> tuple[CommonEffect, ...]:
    """Test every effect over all units.

    Parameters
    ----------
    names : sequence of str, length k
        Candidate effects.
    estimates, sigmas : ndarray, shape (m, k)
        Of each effect in each unit, the effect alone in the model of the unit (SI); NaN where a unit cannot show it.
    rate : float
        False discoveries among those named.

    Returns
    -------
    tuple of CommonEffect
        Those that `FEWEST` units know, smallest probability first.
    """
    known = np.isfinite(estimates) & np.isfinite(sigmas) & (sigmas > 0.0)
    looked_at = [k for k in range(len(names)) if known[:, k].sum() >= FEWEST]
    rows = [_fit(estimates[known[:, k], k], sigmas[known[:, k], k]) for k in looked_at]
    q_values = adjusted(np.array([row[-1] for row in rows]))
    found = [
        CommonEffect(names[k], int(known[:, k].sum()), *row, float(q), bool(q <= rate))
        for k, row, q in zip(looked_at, rows, q_values, strict=True)
    ]
    return tuple(sorted(found, key=lambda one: one.p_value))


def _fit(y: Floats, s: Floats) -> tuple[float, float, float, float, float]:
    """Mean, its sigma, spread, largest |z| and probability of one effect."""
    unit = float(np.sqrt(np.mean(s**2)))
    y, errors = y / unit, (s / unit) ** 2

    def at(tau2: Floats) -> tuple[Floats, Floats, Floats]:
        w = 1.0 / (tau2[:, None] + errors)
        mean = (w * y).sum(axis=1) / w.sum(axis=1)
        q = (w * (y - mean[:, None]) ** 2).sum(axis=1)
        return 0.5 * (np.log(w).sum(axis=1) - q), mean, 1.0 / np.sqrt(w.sum(axis=1))

    tau2 = best_variance(lambda t: at(t)[0], float(np.ptp(y)) ** 2)
    likelihood, mean, sigma = at(np.array([tau2]))
    ratio = 2.0 * float(likelihood[0] - 0.5 * (-np.log(errors).sum() - np.sum(y**2 / errors)))
    return (
        unit * float(mean[0]), unit * float(sigma[0]), unit * float(np.sqrt(tau2)),
        float(np.abs(y / np.sqrt(errors)).max()), boundary_tail(max(ratio, 0.0)),
    )  # fmt: skip


def boundary_tail(ratio: float) -> float:
    """Probability that chi2 with one or with two degrees of freedom, in equal shares, exceeds `ratio`."""
    return 0.5 * (chi2_tail(ratio, 1) + chi2_tail(ratio, 2))


def adjusted(p_values: Floats) -> Floats:
    """Adjust probabilities for their number so that a limit on them limits the false discoveries.

    Parameters
    ----------
    p_values : ndarray, shape (k,)
        Probabilities.

    Returns
    -------
    ndarray, shape (k,)
        The smallest rate (dimensionless) at which each is named (Benjamini & Hochberg).
    """
    count = len(p_values)
    order = np.argsort(p_values)
    stepped = p_values[order] * count / np.arange(1, count + 1)
    out = np.empty(count)
    out[order] = np.minimum(np.minimum.accumulate(stepped[::-1])[::-1], 1.0)
    return out
