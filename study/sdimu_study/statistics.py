"""What a campaign says of an estimator: is it unbiased, is its sigma honest, does it reach the bound.

Errors, covariances and innovations of a right filter have known distributions; every figure here comes with the
interval in which it falls with probability `LEVEL` (of the whole family, where there are several of a kind).

Source: Bar-Shalom, Li & Kirubarajan, *Estimation with Applications to Tracking and Navigation*, section 5.4 (NEES, NIS
and whiteness tests over Monte-Carlo runs).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.recording import DataError

LEVEL = 0.99
"""Probability with which a right filter passes each check."""
BOUND_MARGIN = 1.1
"""An estimator is at the bound when its RMS error is at most this many times the bound."""
NIS_TOLERANCE = 0.02
"""NIS per degree of freedom must be 1 to this: its interval is far narrower than what linearisation may do."""


@dataclass(frozen=True)
class Check:
    """One figure of merit: what came out, and the interval for a right filter."""

    name: str
    value: float
    low: float
    high: float

    @property
    def passed(self) -> bool:
        """Whether the value is in its interval."""
        return bool(self.low <= self.value <= self.high)


@dataclass(frozen=True)
class CoefficientStatistics:
    """Statistics of n runs for p coefficients; arrays of shape (p,), SI."""

    names: tuple[str, ...]
    bias: Floats
    bias_error: Floats
    """`bias`, `bias_error`: Mean error and its standard error."""
    rms: Floats
    sigma: Floats
    bound: Floats
    """`rms`, `sigma`, `bound`: RMS error, RMS of the reported sigma, bound of the plan."""
    rms_z: Floats
    """RMS of error over its own reported sigma."""


def chi_square_interval(dof: float, level: float = LEVEL) -> tuple[float, float]:
    """Interval of a chi-square variable over its degrees of freedom."""
    tail = 0.5 * (1.0 - level)
    low, high = stats.chi2.ppf([tail, 1.0 - tail], dof) / dof
    return float(low), float(high)


def family_level(count: int) -> float:
    """Level of each of `count` figures so that all are in their intervals with probability `LEVEL` (Bonferroni)."""
    return 1.0 - (1.0 - LEVEL) / max(count, 1)


def rms_interval(runs: int, count: int) -> tuple[float, float]:
    """Interval of the RMS of `runs` unit normal numbers, one of `count` such figures."""
    low, high = chi_square_interval(runs, family_level(count))
    return float(np.sqrt(low)), float(np.sqrt(high))


def coefficient_statistics(
    names: Sequence[str], errors: Floats, sigmas: Floats, bound: Mapping[str, float] | None = None
) -> CoefficientStatistics:
    """Compare errors with sigmas.

    Parameters
    ----------
    names : sequence of str, length p
    errors, sigmas : ndarray, shape (n, p)
        Estimate minus truth, and reported sigma, by run.
    bound : mapping of str to float, optional
        Least possible sigma; by default, and for names that it does not have, the mean reported one.
    """
    n = len(errors)
    if n < 2:
        raise DataError(f"{n} finished runs are too few for statistics: expected at least 2")
    sigma = np.sqrt(np.mean(sigmas**2, axis=0))
    return CoefficientStatistics(
        names=tuple(names),
        bias=errors.mean(axis=0),
        bias_error=errors.std(axis=0, ddof=1) / np.sqrt(n),
        rms=np.sqrt(np.mean(errors**2, axis=0)),
        sigma=sigma,
        bound=np.array([(bound or {}).get(name, s) for name, s in zip(names, sigma, strict=True)]),
        rms_z=np.sqrt(np.mean((errors / sigmas) ** 2, axis=0)),
    )


def bias_check(found: CoefficientStatistics, runs: int) -> Check:
    """Largest bias in its standard errors, against Student's t for all coefficients."""
    z = np.abs(found.bias) / found.bias_error
    worst = int(np.argmax(z))
    tail = 0.5 * (1.0 - family_level(len(z)))
    return Check(
        f"largest bias in standard errors ({found.names[worst]})",
        float(z[worst]),
        0.0,
        float(stats.t.ppf(1.0 - tail, runs - 1)),
    )


def sigma_checks(found: CoefficientStatistics, runs: int) -> tuple[Check, Check]:
    """Smallest and largest RMS of error over sigma."""
    low, high = rms_interval(runs, len(found.names))
    first, last = int(np.argmin(found.rms_z)), int(np.argmax(found.rms_z))
    return (
        Check(f"smallest RMS of error over sigma ({found.names[first]})", float(found.rms_z[first]), low, high),
        Check(f"largest RMS of error over sigma ({found.names[last]})", float(found.rms_z[last]), low, high),
    )


def bound_check(found: CoefficientStatistics, runs: int) -> Check:
    """Largest RMS error over the bound; of few runs, chance goes beyond `BOUND_MARGIN`."""
    ratio = found.rms / found.bound
    worst = int(np.argmax(ratio))
    limit = max(BOUND_MARGIN, rms_interval(runs, len(found.names))[1])
    return Check(f"largest RMS error over the bound ({found.names[worst]})", float(ratio[worst]), 0.0, limit)


def nees_check(nees: Floats, dof: int) -> Check:
    """Mean normalised estimation error squared of runs (n,), per degree of freedom."""
    low, high = chi_square_interval(dof * len(nees))
    return Check(f"NEES per degree of freedom ({dof})", float(np.mean(nees)) / dof, low, high)


def nis_check(nis: Floats, dof: Floats) -> Check:
    """Normalised innovation squared per degree of freedom; sums and numbers by run, shape (n,)."""
    low, high = chi_square_interval(float(dof.sum()))
    return Check(
        "NIS per degree of freedom",
        float(nis.sum() / dof.sum()),
        min(low, 1.0 - NIS_TOLERANCE),
        max(high, 1.0 + NIS_TOLERANCE),
    )


def lag_check(products: Floats, counts: Floats, channels: Sequence[str]) -> Check:
    """Largest lag-1 autocorrelation of normalised innovations in its standard errors.

    Parameters
    ----------
    products, counts : ndarray, shape (n, c)
        Sums and numbers of products of neighbours, by run and channel.
    channels : sequence of str, length c
    """
    z = lag_scores(products, counts)
    measured = np.isfinite(z)
    if not measured.any():
        return Check("no two neighbouring innovations to compare", 0.0, 0.0, 0.0)
    worst = int(np.nanargmax(np.abs(z)))
    limit = float(stats.norm.ppf(1.0 - 0.5 * (1.0 - family_level(int(measured.sum())))))
    return Check(f"largest autocorrelation in standard errors ({channels[worst]})", float(z[worst]), -limit, limit)


def lag_scores(products: Floats, counts: Floats) -> Floats:
    """Sum lag-1 products over all runs, in standard errors, shape (c,); NaN for a channel without any.

    A product of two independent numbers of unit variance has mean 0 and variance 1.
    """
    total = counts.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(total > 0, products.sum(axis=0) / np.sqrt(total), np.nan))


def stack(rows: Sequence[Mapping[str, Any]], key: str) -> Floats:
    """One array of the values of all rows; None (a number that was not finite) becomes NaN."""
    return np.array([row[key] for row in rows], dtype=np.float64)
