"""What an unknown error of a sensor may follow: force, rate and temperature in each stretch, and how far they reach.

The covariance of two stretches falls with the distance of what the error follows. Source: C. Rasmussen, C. Williams,
"Gaussian Processes for Machine Learning" (2006), chapter 4 (squared exponential).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.noise_term import ATTITUDE, RATE, TEMPERATURE

_SMOOTH = (0.3, 0.9)
"""Distances of two directions of force (1) over which an unknown function of them changes, half of its variance each:
17 deg is less than what lies between two attitudes of a plan; with 26 deg waves of 6 to 9 rad/g lose 5 to 26 of their
log-likelihood. 52 deg gives the part of a function that coefficients take up the size that it may have."""
_RATES = 0.3
"""Share of the largest rate (1) over which an unknown function of the rate changes: the senses of a turn lie apart, and
so do 2 and 10 deg/s."""
_TEMPERATURES = 0.25
"""Share of the span of temperatures (1) over which an unknown function of them changes: a straight line is in the
catalogue."""
_LEAST_SPAN_K = 1.0
"""Span of temperatures (K) below which nothing is said to follow them: a thermometer is as good as that."""


@dataclass(frozen=True)
class Conditions:
    """Means over s stretches."""

    force: Floats
    """Direction of the specific force, in b, of unit length where the IMU stands (1), shape (s, 3)."""
    rate: Floats
    """Body rate against the Earth, in b (rad/s), shape (s, 3)."""
    temperature: Floats
    """Shape (s,). T - T0 (K); zero where none is recorded."""

    @property
    def followed(self) -> tuple[str, ...]:
        """Kinds of noise that can be told here: an error that follows the attitude, the rate, the temperature."""
        moved = (RATE,) if np.abs(self.rate).max(initial=0.0) > 0.0 else ()
        heated = (TEMPERATURE,) if np.ptp(self.temperature) > _LEAST_SPAN_K else ()
        return (ATTITUDE, *moved, *heated)

    def variable(self, kind: str) -> Floats:
        """Give what an error of a kind follows.

        Parameters
        ----------
        kind : str
            One of `followed`.

        Returns
        -------
        ndarray, shape (s, k)
            Force (1), rate (rad/s) or temperature (K).
        """
        return {ATTITUDE: self.force, RATE: self.rate, TEMPERATURE: self.temperature[:, None]}[kind]

    def kernel(self, kind: str) -> Floats:
        """Covariance of an unknown smooth function of unit variance; one of the rate is zero at rest.

        Parameters
        ----------
        kind : str
            One of `followed`.

        Returns
        -------
        ndarray, shape (s, s)
            (1).
        """
        x = self.variable(kind)
        if kind == ATTITUDE:
            return alike_attitudes(x, x)
        if kind == TEMPERATURE:
            return _alike(x, x, _TEMPERATURES * float(np.ptp(x)))
        reach = _RATES * float(np.linalg.norm(x, axis=1).max())
        at_rest = _alike(x, np.zeros((1, 3)), reach)[:, 0]
        return _alike(x, x, reach) - np.outer(at_rest, at_rest)


def alike_attitudes(u: Floats, v: Floats) -> Floats:
    """Covariance of an unknown function of unit variance at two lists of directions of force in b.

    Parameters
    ----------
    u, v : ndarray, shapes (n, 3), (m, 3)
        (1).

    Returns
    -------
    ndarray, shape (n, m)
        (1).
    """
    return np.asarray(np.mean([_alike(u, v, reach) for reach in _SMOOTH], axis=0))


def _alike(x: Floats, y: Floats, reach: float) -> Floats:
    apart = np.sum(x**2, axis=1)[:, None] + np.sum(y**2, axis=1)[None, :] - 2.0 * (x @ y.T)
    return np.asarray(np.exp(-0.5 * np.maximum(apart, 0.0) / reach**2))


def conditions(seen: Motion, start: Floats, end: Floats) -> Conditions:
    """Take the means of what a navigation has seen.

    Parameters
    ----------
    seen : Motion
        n cycles.
    start, end : ndarray, shape (s,)
        Of each stretch (s).
    """
    direction = seen.f / np.linalg.norm(seen.f, axis=1)[:, None]
    every = np.column_stack([direction, seen.w_table, seen.temperature])
    middle = seen.t - 0.5 * seen.dt
    out = np.zeros((len(start), every.shape[1]))
    for k, (begin, until) in enumerate(zip(start.tolist(), end.tolist(), strict=True)):
        first, last = np.searchsorted(middle, (begin, until))
        # A stretch shorter than a cycle has that of the cycle it lies in.
        out[k] = every[min(first, len(every) - 1) : max(last, first + 1)].mean(axis=0)
    return Conditions(out[:, :3], out[:, 3:6], out[:, 6])
