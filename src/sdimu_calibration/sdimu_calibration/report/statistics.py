"""Numbers that a statistician looks for: are the innovations white and normal, which stop carries an estimate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri, ndtri

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.evidence.influence import influence
from sdimu_calibration.core.probability import normal_limit

KINDS = ("position", "velocity", "rate", "force")
_LAGS = 30
"""Number of lags of the autocorrelation: half a minute at rest."""
_BINS = np.linspace(-5.0, 5.0, 41)
"""Edges of the histogram (sigma)."""
_QUANTILES = 80
"""Number of points of a QQ plot: enough for a line, with the tails kept one by one."""
_TAIL = 12
"""Number of the smallest and of the largest values that a QQ plot keeps one by one."""
LEVEL = 0.95
"""Probability of the bands."""


@dataclass(frozen=True)
class Whiteness:
    """Whitened innovations of a finished fit in four kinds: position, velocity, rate, force."""

    bins: Floats
    """Middles of the bins of the histogram (sigma), shape (b,)."""
    density: Floats
    """Shape (4, b). Probability density; zero where a kind is not measured."""
    expected: tuple[Floats, ...]
    found: tuple[Floats, ...]
    """`expected`, `found`: quantiles of the normal distribution and of each kind (sigma), each shape (q,)."""
    lags: Ints
    """Epochs, shape (l,)."""
    correlation: Floats
    """Autocorrelation of gyro x, y, z and accelerometer x, y, z within the stops (dimensionless), shape (l, 6)."""
    band: float
    """What white noise stays inside with `LEVEL`."""
    t: Floats
    """Middle of each stop (min), shape (s,)."""
    stop: Ints
    """Shape (s,)."""
    nis: Floats
    """Shape (s, 4). Mean NIS per degree of freedom at each stop; NaN where not measured."""
    low: Floats
    high: Floats
    """`low`, `high`: band of `nis` with `LEVEL`, shape (s, 4)."""


def whiteness(fit: NavigationFit) -> Whiteness:
    """Take the innovations of the last pass of a fit apart."""
    white, nis = fit.last.output.normalised, fit.last.output.nis
    stop, used = fit.prepared.phases.stop, fit.prepared.kind > 0
    kinds = [white[:, 3 * k : 3 * k + 3][np.isfinite(white[:, 3 * k : 3 * k + 3])] for k in range(4)]
    density = [np.histogram(v, _BINS, density=True)[0] if len(v) else np.zeros(len(_BINS) - 1) for v in kinds]
    quantiles = [_quantiles(v) for v in kinds]
    correlation, pairs = _autocorrelation(white[:, 6:], stop, used)
    stops = np.unique(stop[used])
    mean, count = np.full((len(stops), 4), np.nan), np.zeros((len(stops), 4))
    for row, one in enumerate(stops):
        at = nis[used & (stop == one)]
        count[row] = np.isfinite(at).sum(axis=0)
        mean[row] = np.where(count[row] > 0, np.nansum(at, axis=0) / np.maximum(3.0 * count[row], 1.0), np.nan)
    dof = 3.0 * np.maximum(count, 1.0)
    low, high = (chdtri(dof, p) / dof for p in (0.5 + 0.5 * LEVEL, 0.5 - 0.5 * LEVEL))
    middle = np.array([fit.prepared.epochs.end[used & (stop == one)].mean() for one in stops]) / 60.0
    return Whiteness(
        0.5 * (_BINS[1:] + _BINS[:-1]),
        np.array(density),
        tuple(e for e, _ in quantiles),
        tuple(f for _, f in quantiles),
        np.arange(1, _LAGS + 1),
        correlation,
        float(normal_limit(0.5 - 0.5 * LEVEL) / np.sqrt(max(pairs, 1))),
        middle,
        stops,
        mean,
        low,
        high,
    )


def _quantiles(values: Floats) -> tuple[Floats, Floats]:
    """Quantiles (q,) of the normal distribution and of `values` (n,), both in sigma; the tails one by one."""
    n = len(values)
    if not n:
        return np.empty(0), np.empty(0)
    middle = np.linspace(0, n - 1, min(n, _QUANTILES)).astype(np.int64)
    rank = np.unique(np.concatenate([np.arange(min(_TAIL, n)), middle, np.arange(max(0, n - _TAIL), n)]))
    return np.asarray(ndtri((rank + 0.5) / n)), np.sort(values)[rank]


def _autocorrelation(white: Floats, stop: Ints, used: Bools) -> tuple[Floats, int]:
    """Correlation (lags, 6) of the columns of `white` (e, 6) with themselves later at the same stop; least pairs."""
    out, least = np.full((_LAGS, white.shape[1]), np.nan), len(white)
    variance = np.nanmean(white[used] ** 2, axis=0)
    for lag in range(1, _LAGS + 1):
        pair = used[lag:] & used[:-lag] & (stop[lag:] == stop[:-lag])
        product = white[lag:][pair] * white[:-lag][pair]
        least = min(least, len(product))
        if len(product):
            out[lag - 1] = np.nanmean(product, axis=0) / variance
    return out, least


@dataclass(frozen=True)
class Influence:
    """How far each coefficient moves without each stop: `moved` (s, k) in sigmas, of `stops` (s,) and `names` (k)."""

    stops: Ints
    names: tuple[str, ...]
    moved: Floats


def influences(fit: NavigationFit) -> Influence:
    """Leave every stop out of a fit in its linear model; of what the estimator estimates, see what is reported."""
    evidence = fit.bare
    stops, moved = influence(evidence)
    reported = [k for k, name in enumerate(evidence.names[: evidence.coefficients]) if name in fit.names]
    return Influence(stops, tuple(evidence.names[k] for k in reported), moved[:, reported])
