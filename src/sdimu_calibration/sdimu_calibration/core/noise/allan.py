"""Overlapping Allan deviation of rates (rad/s) or specific forces (m/s^2), pooled over stretches of rest.

The overlapping Allan variance at an averaging time is a mean over differences; each stretch adds its differences, so
that turns and gaps between stretches have no influence.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints

_PER_OCTAVE = 2
"""Number of averaging times an octave: neighbours share most of their data."""
LEAST_FREEDOM = 3.0
"""Least number of degrees of freedom of an averaging time: with fewer the variance is uncertain by its own size."""


@dataclass(frozen=True)
class Allan:
    """Allan deviation of one channel."""

    tau: Floats
    """Averaging times (s), shape (k,)."""
    deviation: Floats
    """In the unit of the channel, shape (k,)."""
    freedom: Floats
    """Equivalent degrees of freedom of the squares, for white noise, shape (k,)."""
    interval_s: float
    lengths: tuple[int, ...]
    """Samples of each stretch."""

    @property
    def sigma(self) -> Floats:
        """Standard error of the deviation, shape (k,), in the unit of the channel."""
        return np.asarray(self.deviation / np.sqrt(2.0 * self.freedom))


def freedom_of(length: int, m: Floats) -> Floats:
    """Equivalent degrees of freedom of the overlapping Allan variance of white noise, shape (k,).

    Source: Riley, *Handbook of Frequency Stability Analysis*, NIST SP 1065 (2008), table 5, white FM.

    Parameters
    ----------
    length : int
        Samples of the stretch.
    m : ndarray, shape (k,)
        Averaging times (samples).
    """
    n = float(length + 1)
    out = (3.0 * (n - 1.0) / (2.0 * m) - 2.0 * (n - 2.0) / n) * 4.0 * m**2 / (4.0 * m**2 + 5.0)
    return np.asarray(np.where(2.0 * m <= length, np.maximum(out, 0.0), 0.0))


def factors(longest: int) -> Ints:
    """Averaging factors for stretches of at most `longest` samples: powers of the square root of two, shape (k,)."""
    steps = np.arange(0.0, _PER_OCTAVE * np.log2(max(longest / 2.0, 1.0)) + 1e-9)
    return np.unique(np.rint(2.0 ** (steps / _PER_OCTAVE)).astype(np.int64))


def overlapping(samples: Floats, m: Ints) -> Floats:
    """Overlapping Allan deviation of one stretch in the unit of the samples, shape (k,).

    Source: Riley, *Handbook of Frequency Stability Analysis*, NIST SP 1065 (2008), eq. 11.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Without gaps, any unit.
    m : ndarray of int, shape (k,)
        Averaging times (samples), each less than half of n.
    """
    phase = np.concatenate([[0.0], np.cumsum(samples - samples.mean())])
    deviation = np.empty(len(m))
    for place, step in enumerate(m.tolist()):
        second = phase[2 * step :] - 2.0 * phase[step:-step] + phase[: -2 * step]
        deviation[place] = np.sqrt(np.sum(second * second) / (2.0 * len(second))) / step
    return deviation


def allan(stretches: Sequence[Floats], interval_s: float) -> Allan:
    """Allan deviation of a channel.

    Parameters
    ----------
    stretches : sequence of ndarray, shape (n_i,)
        Samples at rest, each stretch without gaps.
    """
    m = factors(max(map(len, stretches)))
    total, pairs, freedom = np.zeros(len(m)), np.zeros(len(m)), np.zeros(len(m))
    for samples in stretches:
        rows = np.flatnonzero(2 * m < len(samples))
        own = m[rows]
        weight = len(samples) + 1.0 - 2.0 * own
        total[rows] += weight * overlapping(samples - samples.mean(), own) ** 2
        pairs[rows] += weight
        freedom[rows] += freedom_of(len(samples), own.astype(np.float64))
    keep = freedom > LEAST_FREEDOM
    pooled: Floats = np.sqrt(total[keep] / pairs[keep])
    times: Floats = m[keep].astype(np.float64) * interval_s
    return Allan(times, pooled, freedom[keep], interval_s, tuple(map(len, stretches)))
