"""True memory of a suspension, block by block: what a sample adds depends on all samples before."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.compiled import compiled

Memory = Callable[[Floats], Floats]
"""Takes the next samples (m,) of a signal and gives what is remembered of it at each; same digits however it is cut."""


class Lag:
    """First-order lag for a signal that is straight between samples; at rest with the first sample.

    The ramp-invariant filter: exact for such signals, with unit gain for constant ones.
    """

    def __init__(self, tau: float, interval_s: float) -> None:
        share = interval_s / tau
        decay = np.exp(-share)
        mean = -np.expm1(-share) / share
        self._forward, self._back = np.array([1.0 - mean, mean - decay]), np.array([1.0, -decay])
        self._state: Floats | None = None

    def __call__(self, v: Floats) -> Floats:
        """Lagged samples (m,) of the next samples (m,), in the unit of the signal."""
        from scipy.signal import lfilter  # noqa: PLC0415 (0.8 s that a simulation without a lag does not need)

        if not len(v):
            return v
        if self._state is None:
            self._state = np.array([(1.0 - self._forward[0]) * v[0]])
        out, self._state = lfilter(self._forward, self._back, v, zi=self._state)
        return np.asarray(out)


class Play:
    """A slider of half-width `band` (unit of the signal) that the signal pushes; the signal starts in its middle."""

    def __init__(self, band: float) -> None:
        self._band = band
        self._place: float | None = None

    def __call__(self, v: Floats) -> Floats:
        """Places (m,) of the middle of the slider after each of the next samples (m,)."""
        if not len(v):
            return v
        out = _pushed(v, self._band, v[0] if self._place is None else self._place)
        self._place = float(out[-1])
        return out


@compiled
def _pushed(v: Floats, band: float, place: float) -> Floats:
    out = np.empty(len(v))
    for k in range(len(v)):
        ahead = v[k] - place
        if ahead > band:
            place += ahead - band
        elif ahead < -band:
            place += ahead + band
        out[k] = place
    return out


def memory(kind: str, option: float, interval_s: float) -> Memory:
    """Make an empty memory: ``lag`` with a time constant (s), or ``play`` with a half-width (unit of the signal)."""
    return Lag(option, interval_s) if kind == "lag" else Play(option)
