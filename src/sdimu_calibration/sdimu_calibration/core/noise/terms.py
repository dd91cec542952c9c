"""Noise terms that explain an Allan deviation.

    variance(tau) = 3 Q^2 / tau^2 + N^2 / tau + (2 ln 2 / pi) B^2 + K^2 tau / 3

with quantisation Q, white noise N (angle or velocity random walk), bias instability B (flicker) and random walk K of
the bias. Source: IEEE Std 952-1997, annex C. The variance is linear in the squares of the terms, so they follow from a
non-negative least squares in which each variance has the weight of its standard error under the fit. Neighbouring
averaging times share data, so the standard errors of the terms are the scatter of the same fit on simulated noise. A
term that is absent still gets a positive value, because none may be negative, so the fit is repeated with only the
terms that exceed their standard errors.

Vibration, a base that rocks and filters in the sensor follow no slope of these. Where the terms do not explain the
variances, each variance gets a relative error beyond its standard error, as large as makes the residuals what they are
(Paule & Mandel, J. Res. NBS 87, 1982): long averaging times then count beside short ones, which are known to a
thousandth, and the standard errors of the terms say what such terms are worth.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.noise.allan import Allan, allan

TERMS = ("quantisation", "white", "instability", "random_walk")
_ROUNDS = 6
"""Number of least squares: the weights of each depend on the fit before it and converge in a few."""
_DRAWS = 24
"""Number of simulations: standard errors to 14 %."""
_SEEN = 3.0
"""Least ratio of a term to its sigma at which it counts as seen: one false term in a thousand."""
_EXPLAINED = 4.0
"""Mean square of the residuals (sigma) from which the terms do not explain the variances: they share data, so chance
makes it 1 to 3."""
_HALVINGS = 40
"""Number of halvings in the search for the relative error: to rounding."""
_ROOM = 2.0
"""Multiple of sigma above the fit that bounds a term that is not seen: 97.7 % of a Gaussian."""


@dataclass(frozen=True)
class Terms:
    """Fitted terms of one channel, in the order of `TERMS`."""

    value: Floats
    sigma: Floats
    """`value`, `sigma`: Q (unit s), N (unit sqrt(s)), B (unit), K (unit/sqrt(s)), with the unit of the channel,
    shape (4,)."""
    misfit: float = 0.0
    """Relative error of the variances beyond their standard errors; 0 where the terms explain them."""
    worst_s: float = 0.0
    worst_ratio: float = 1.0
    """`worst_s`, `worst_ratio`: averaging time (s) at which the deviation exceeds that of the terms most, and by what
    factor."""

    @property
    def seen(self) -> Bools:
        """Terms that exceed their sigma, shape (4,); of the others only `upper` is known."""
        seen: Bools = self.value > _SEEN * self.sigma
        return seen

    @property
    def upper(self) -> Floats:
        """Upper bound of each term, shape (4,), two sigma above the fit."""
        return np.asarray(self.value + _ROOM * self.sigma)

    def deviation(self, tau: Floats) -> Floats:
        """Allan deviation of the terms that are seen, in the unit of the channel, shape (k,).

        Parameters
        ----------
        tau : ndarray, shape (k,)
            Averaging times (s).
        """
        return np.asarray(np.sqrt(basis(tau) @ (self.value * self.seen) ** 2))


def basis(tau: Floats) -> Floats:
    """Variance per square of each term, in the order of `TERMS` (1/s^2, 1/s, 1, s), shape (k, 4).

    Parameters
    ----------
    tau : ndarray, shape (k,)
        Averaging times (s).
    """
    one = np.ones(len(tau))
    return np.column_stack([3.0 / tau**2, 1.0 / tau, 2.0 * np.log(2.0) / np.pi * one, tau / 3.0])


def fit_terms(found: Allan, rng: np.random.Generator, draws: int = _DRAWS) -> Terms:
    """Fit the terms.

    `rng`: for the draws that give the standard errors; `draws`: the standard errors are known to ``1 / sqrt(2 draws)``.
    """
    misfit = _misfit(found)
    value = np.sqrt(_squares(found, misfit=misfit))
    again = [
        allan([drawn(value, n, found.interval_s, rng) for n in found.lengths], found.interval_s) for _ in range(draws)
    ]
    if misfit:
        # The terms of a channel that they do not explain are known as its deviation follows them.
        again = [_disturbed(one, misfit, rng) for one in again]
    sigma = _scatter(again, value, None, misfit)
    seen = value > _SEEN * sigma
    alone = np.sqrt(_squares(found, seen, misfit))
    value = np.where(seen, alone, value)
    ratio = found.deviation / np.maximum(np.sqrt(basis(found.tau) @ value**2), 1e-300)
    worst = int(np.argmax(ratio))
    return Terms(
        value,
        np.where(seen, _scatter(again, value, seen, misfit), sigma),
        misfit,
        float(found.tau[worst]),
        float(ratio[worst]),
    )


def _misfit(found: Allan) -> float:
    """Relative error of the variances that explains what the terms leave over beyond standard errors; mostly 0."""
    if not np.any(found.deviation):
        return 0.0
    error = 0.0
    for _ in range(_ROUNDS):
        fitted = basis(found.tau) @ _squares(found, misfit=error)
        left = np.log(found.deviation**2 / np.maximum(fitted, 1e-300)) ** 2
        if not np.isfinite(left).all() or np.mean(left * found.freedom / 2.0) < _EXPLAINED:
            return 0.0
        low, high = 0.0, float(np.sqrt(left.max()))
        for _halving in range(_HALVINGS):
            error = 0.5 * (low + high)
            excess = float(np.mean(left / (2.0 / found.freedom + error**2))) > 1.0
            low, high = (error, high) if excess else (low, error)
    return error


def _disturbed(one: Allan, misfit: float, rng: np.random.Generator) -> Allan:
    """Disturb the variances of a draw as those of the recording are."""
    factor = np.exp(0.5 * misfit * rng.standard_normal(len(one.tau)))
    return replace(one, deviation=one.deviation * factor)


def _scatter(again: list[Allan], value: Floats, among: Bools | None, misfit: float = 0.0) -> Floats:
    """Scatter of the fits on draws about the terms `value` (4,) that they were drawn with."""
    fits = np.array([np.sqrt(_squares(one, among, misfit)) for one in again])
    if among is None:
        return np.asarray(np.sqrt(np.mean((fits - value) ** 2, axis=0)))
    # Fits without the terms that are left out have another mean.
    return np.asarray(fits.std(axis=0, ddof=1))


def _squares(found: Allan, among: Bools | None = None, misfit: float = 0.0) -> Floats:
    """Non-negative least squares for the squares of the terms `among`, the others zero."""
    from scipy.optimize import nnls  # noqa: PLC0415 (half a second that a calibration does not need)

    variance, columns = found.deviation**2, basis(found.tau)
    if among is not None:
        columns = columns * among
    if not np.any(variance):
        return np.zeros(len(TERMS))
    fitted = variance
    out = np.zeros(len(TERMS))
    for _ in range(_ROUNDS):
        # Beside what the terms do not explain a variance is known to its own size at best, not to that of the fit.
        size = np.maximum(fitted, variance) if misfit else np.maximum(fitted, 1e-12 * variance.max())
        weight = 1.0 / (size * np.sqrt(2.0 / found.freedom + misfit**2))
        rows = columns * weight[:, None]
        scale = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
        out = nnls(rows / scale, variance * weight)[0] / scale
        fitted = columns @ out
    return np.asarray(out)


def drawn(value: Floats, n: int, interval_s: float, rng: np.random.Generator) -> Floats:
    """Simulate noise in the unit of the channel, shape (n,).

    Parameters
    ----------
    value : ndarray, shape (4,)
        Terms, with the units of `Terms.value`.
    interval_s : float
        Time over which each sample is a mean.
    """
    Q, N, B, K = value
    edges = Q * rng.standard_normal(n + 1)
    out = np.diff(edges) / interval_s
    out += N / np.sqrt(interval_s) * rng.standard_normal(n)
    out += K * np.sqrt(interval_s) * np.cumsum(rng.standard_normal(n))
    if B:
        out += B * _flicker(n, rng)
    return np.asarray(out)


def _flicker(n: int, rng: np.random.Generator) -> Floats:
    """Flicker noise with the two-sided density ``1 / (2 pi f)`` of a unit B, the same at every sample rate."""
    # Longer than asked for: the ends of a spectrum are joined.
    length = 4 * n
    f = np.fft.rfftfreq(length)
    density = np.zeros(len(f))
    density[1:] = 1.0 / (2.0 * np.pi * f[1:])
    real, imaginary = rng.standard_normal((2, len(f)))
    spectrum = np.sqrt(0.5 * density * length) * (real + 1j * imaginary)
    return np.asarray(np.fft.irfft(spectrum, length)[:n])
