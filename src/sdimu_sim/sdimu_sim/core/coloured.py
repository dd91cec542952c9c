"""Noise of the true sensors that has a memory, sample by sample: made apart from the model that the estimator has.

    gyro_noise_random_walk=0.01 deg/h/sqrt(h)     the bias walks (rate random walk K)
    accel_noise_flicker=5 ug                      bias instability B: density B^2/(2 pi f)
    gyro_noise_markov(tau=300 s)=0.02 deg/h       first-order Gauss-Markov
    gyro_noise_stop=0.02 deg/h                    a bias drawn anew at each stop
    gyro_noise_turn=0.02 deg/h                    a bias drawn anew in each turn
    gyro_noise_shift=0.02 deg/h                   a bias that each turn shifts for good

Each of the three sensors of a triad has a draw of its own. Source of the terms: IEEE Std 952-1997, annex C.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.effect_key import parse_key, read_options, read_quantity
from sdimu_calibration.core.recording import DataError
from sdimu_sim.core.truth import child_rng

KINDS = ("random_walk", "flicker", "markov", "stop", "turn", "shift")
"""Kinds of noise with a memory."""
_UNITS = {"gyro": "deg/h", "accel": "ug"}
_SHORTEST_S, _LONGEST_S, _RATIO = 0.5, 1e6, 2.5
"""Time constants of the Markov terms that make flicker noise: first, last (s) and ratio of neighbours."""


@dataclass(frozen=True)
class NoiseKey:
    """A noise term as it was stated: triad, kind, time constant (s; 0 where there is none), size (SI)."""

    triad: str
    kind: str
    tau: float
    size: float


def parse_noise(text: str) -> NoiseKey:
    """Read a noise term."""
    key = parse_key(text)
    triad, _, kind = key.name.partition("_noise_")
    if triad not in _UNITS or kind not in KINDS:
        known = ", ".join(KINDS)
        raise DataError(f"noise '{text}': expected gyro_noise_KIND=SIZE or accel_noise_KIND=SIZE, KIND one of {known}")
    options = read_options(key, {"tau": "s"} if kind == "markov" else {})
    unit = _UNITS[triad] + ("/sqrt(h)" if kind == "random_walk" else "")
    if not key.size:
        raise DataError(f"noise '{text}': no size (expected {key.name}=1 {unit})")
    size = read_quantity(f"noise '{text}'", key.size, unit)
    if not size >= 0.0 or not options.get("tau", 1.0) > 0.0:
        raise DataError(f"noise '{text}': size and time constant must be positive")
    return NoiseKey(triad, kind, options.get("tau", 0.0), size)


class ColouredNoise:
    """Wandering biases of the six sensors, block by block; the same digits however a test is cut into blocks."""

    def __init__(self, terms: Sequence[str], interval_s: float, seed: int) -> None:
        self._terms = [_Term(parse_noise(text), interval_s, seed, place) for place, text in enumerate(terms)]

    def add(self, readings: Floats, moving: Bools) -> None:
        """Add the next block to the readings (6, m); `moving` (m,) says when the table turns."""
        for term in self._terms:
            first = 0 if term.key.triad == "gyro" else 3
            readings[first : first + 3] += term.block(moving).T


class _Term:
    """One term with its streams and its state."""

    def __init__(self, key: NoiseKey, interval_s: float, seed: int, place: int) -> None:
        self.key = key
        self._rng = child_rng(seed, f"{key.triad} {key.kind} {place}")
        self._moving = False
        self._begun = False
        if key.kind == "random_walk":
            self._decay, self._drive = np.ones(1), np.array([key.size * np.sqrt(interval_s)])
            self._state = np.zeros((1, 3))
        elif key.kind in {"markov", "flicker"}:
            taus = np.array([key.tau]) if key.kind == "markov" else _taus()
            variance = key.size**2 * (1.0 if key.kind == "markov" else np.log(_RATIO) / np.pi)
            self._decay = np.exp(-interval_s / taus)
            self._drive = np.sqrt(variance * (1.0 - self._decay**2))
            self._state = np.sqrt(variance) * self._rng.standard_normal((len(taus), 3))
        else:
            self._state = np.zeros((1, 3))

    def block(self, moving: Bools) -> Floats:
        """Next values, shape (m, 3)."""
        if self.key.kind in {"random_walk", "markov", "flicker"}:
            draws = self._rng.standard_normal((len(moving), len(self._decay), 3))
            return np.asarray(_recursion(draws, self._decay, self._drive, self._state))
        return self._drawn(moving)

    def _drawn(self, moving: Bools) -> Floats:
        out = np.empty((len(moving), 3))
        edges = np.flatnonzero(np.diff(np.concatenate([[self._moving], moving]).astype(int))).tolist()
        for a, b in pairwise(sorted({0, *edges, len(moving)})):
            if a in edges or not self._begun:
                self._change(bool(moving[a]))
            applies = self.key.kind == "shift" or bool(moving[min(a, len(moving) - 1)]) == (self.key.kind == "turn")
            out[a:b] = self._state[0] if applies else 0.0
        self._moving = bool(moving[-1]) if len(moving) else self._moving
        return out

    def _change(self, turns: bool) -> None:
        """Draw what begins with a turn or with a stop."""
        self._begun = True
        fresh = self.key.size * self._rng.standard_normal(3)
        if self.key.kind == "shift":
            self._state[0] += fresh if turns else 0.0
        else:
            self._state[0] = fresh


def _taus() -> Floats:
    count = int(np.ceil(np.log(_LONGEST_S / _SHORTEST_S) / np.log(_RATIO))) + 1
    return np.asarray(_SHORTEST_S * _RATIO ** np.arange(count))


@compiled
def _recursion(draws: Floats, decay: Floats, drive: Floats, state: Floats) -> Floats:
    """Sum of first-order recursions, ``x <- decay x + drive draw`` (m, k, 3) with the state (k, 3) in place; (m, 3)."""
    out = np.zeros((draws.shape[0], 3))
    for i in range(draws.shape[0]):
        for k in range(decay.shape[0]):
            for j in range(3):
                state[k, j] = decay[k] * state[k, j] + drive[k] * draws[i, k, j]
                out[i, j] += state[k, j]
    return out
