"""Effects that are too weak in one unit and common to the type: their mean over units, or their variance, is not zero.

Each unit gives an estimate and its sigma for every candidate effect, however small. Per effect: twice the log of the
ratio of likelihoods between ``N(mean, sigma_i^2 + tau^2)`` and ``N(0, sigma_i^2)``. Without an effect it is, for many
units, chi2 with one degree of freedom or with two in equal shares, because tau cannot be below zero (Self & Liang, JASA
82, 1987); for few units it is less. Over all effects the share of false ones among those named is held (Benjamini &
Hochberg, JRSS B 57, 1995).

A real effect makes every candidate that resembles it large, too. Where the correlations of the estimates are known,
effects are therefore named one at a time, the most probable first, and the others are tested again with it estimated
along in every unit: what it explains of them is gone, and those that say hardly anything of their own stand beside it
as alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.fleet.reml import best_variance
from sdimu_calibration.core.probability import chi2_tail

Bytes = NDArray[np.int8]
FALSE_DISCOVERY = 0.05
"""Share of false effects among those named, on average (dimensionless): what the issue of a type can bear."""
FEWEST = 3
"""Number of units that have to know an effect: with fewer, mean and variance are one."""

OWN = 0.3
"""Share of the signature of an effect that those named must leave (dimensionless): with less it is alike."""
_AS_LIKELY = 3.0
"""Difference of log-likelihoods (1) up to which two effects are not told apart: odds of 20 to 1, as in a diagnosis."""
_RIDGE = 1e-3
"""Variance added to that of a score (1): correlations are kept to 1/254."""
STEPS = 127.0
"""Number by which correlations are kept as whole ones: they fit into a byte."""


@dataclass(frozen=True)
class CommonEffect:
    """One candidate effect over units, in its SI unit."""

    name: str
    """Coefficient."""
    units: int
    """Units that know it."""
    mean: float
    mean_sigma: float
    """`mean`, `mean_sigma`: over units."""
    spread: float
    """Standard deviation between units (maximum likelihood)."""
    largest_z: float
    """Of the units alone: largest estimate in sigmas."""
    p_value: float
    """If neither mean nor variance is there."""
    q_value: float
    """Smallest rate of false discoveries at which it is named."""
    named: bool
    ratio: float = 0.0
    """Twice the log of the ratio of likelihoods."""
    alike: tuple[str, ...] = ()
    """Effects that the units do not tell from it; empty for those that are not named."""


def common_effects(
    names: Sequence[str], estimates: Floats, sigmas: Floats, correlations: Bytes | None = None
) -> tuple[CommonEffect, ...]:
    """Test every effect over all units.

    Parameters
    ----------
    names : sequence of str, length k
        Candidate effects.
    estimates, sigmas : ndarray, shape (m, k)
        Of each effect in each unit, the effect alone in the model of the unit (SI); NaN where a unit cannot show it.
    correlations : ndarray of int, shape (m, k, k), optional
        Of the estimates in each unit, times `STEPS`; without them all that stand out are named at once.

    Returns
    -------
    tuple of CommonEffect
        Those that `FEWEST` units know: those named in their order, then by probability.
    """
    if correlations is None:
        return _tested(names, estimates, sigmas)
    chosen: list[int] = []
    named: list[CommonEffect] = []
    while True:
        found = _tested(names, *given(estimates, sigmas, correlations, chosen))
        if not found or not found[0].named:
            break
        top = found[0]
        k = names.index(top.name)
        near = np.abs(correlations[:, k]).mean(axis=0) > (1.0 - OWN) * STEPS
        close = {e.name for e in found[1:] if _gain(e) > _gain(top) - _AS_LIKELY}
        alike = tuple(name for name, is_near in zip(names, near.tolist(), strict=True) if is_near and name in close)
        chosen.append(k)
        named.append(replace(top, alike=alike))
    return (*named, *(replace(one, named=False) for one in found))


def _gain(one: CommonEffect) -> float:
    """Log-likelihood that an effect adds."""
    return 0.5 * one.ratio


def given(estimates: Floats, sigmas: Floats, correlations: Bytes, chosen: Sequence[int]) -> tuple[Floats, Floats]:
    """Estimate every effect with some others estimated along.

    Parameters
    ----------
    estimates, sigmas : ndarray, shape (m, k)
        Of each effect alone in each unit (SI).
    correlations : ndarray of int, shape (m, k, k)
        As for `common_effects`.

    Returns
    -------
    estimates, sigmas : ndarray, shape (m, k)
        SI; NaN for those chosen, and for those that keep less than `OWN` of their signature.
    """
    if not chosen:
        return estimates, sigmas
    out = np.full((2, *estimates.shape), np.nan)
    for unit, (value, sigma) in enumerate(zip(estimates, sigmas, strict=True)):
        along = [k for k in chosen if np.isfinite(value[k]) and sigma[k] > 0.0]
        R = correlations[unit][:, along] / STEPS
        between = R[along] + _RIDGE * np.eye(len(along))
        share = np.sqrt(np.clip(1.0 - np.einsum("ks,sk->k", R, np.linalg.solve(between, R.T)), 0.0, 1.0))
        z = value / sigma - R @ np.linalg.solve(between, value[along] / sigma[along])
        own = share > OWN
        own[chosen] = False
        out[0, unit, own] = (z * sigma)[own] / share[own] ** 2
        out[1, unit, own] = sigma[own] / share[own]
    return out[0], out[1]


def _tested(names: Sequence[str], estimates: Floats, sigmas: Floats) -> tuple[CommonEffect, ...]:
    """Test every effect by itself, smallest probability first."""
    known = np.isfinite(estimates) & np.isfinite(sigmas) & (sigmas > 0.0)
    looked_at = [k for k in range(len(names)) if known[:, k].sum() >= FEWEST]
    rows = [_fit(estimates[known[:, k], k], sigmas[known[:, k], k]) for k in looked_at]
    q_values = adjusted(np.array([row[-2] for row in rows]))
    found = [
        CommonEffect(names[k], int(known[:, k].sum()), *row[:-1], float(q), bool(q <= FALSE_DISCOVERY), row[-1])
        for k, row, q in zip(looked_at, rows, q_values, strict=True)
    ]
    return tuple(sorted(found, key=lambda one: (one.p_value, -one.ratio)))


def _fit(y: Floats, s: Floats) -> tuple[float, float, float, float, float, float]:
    """Mean, its sigma, spread, largest |z|, probability and statistic of one effect."""
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
        unit * float(mean[0]),
        unit * float(sigma[0]),
        unit * float(np.sqrt(tau2)),
        float(np.abs(y / np.sqrt(errors)).max()),
        boundary_tail(max(ratio, 0.0)),
        ratio,
    )


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
