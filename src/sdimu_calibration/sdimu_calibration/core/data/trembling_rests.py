"""Rests that tremble: found by relaxing the threshold of static detection in steps, each weighed by its own scatter.

An IMU that is held, or put down on something soft, scatters more at rest than the quietest tenth of the recording does.
Its mean is still that of gravity. How far it moves about its mean is seen in the samples: the rate, integrated over the
rest, is the angle by which it left its mean attitude, and the force the speed.

Source of the idea: Tedaldi, Pretto & Menegatti, ICRA 2014, who try many thresholds and keep the one that leaves least.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.data.static_detection import SCATTER, WINDOW_S, StaticIntervals, detect_static
from sdimu_calibration.core.recording import DataError, Recording

STEPS = (SCATTER, 8.0, 16.0, 32.0, 64.0)
"""Scatter (variance) of a rest at most, as multiples of that of the quietest windows: up to eight times their sigma."""
_WHOLE = 0.5
"""Share of a rest at a higher step from which the piece found before stands for it: less is a quiet moment of a
tremble."""
_BRIDGE = 0.141
"""Median over time of the mean square of three axes of white noise, integrated about the chord of its ends (q^2 T):
mean of 20 000 draws of Brownian bridges."""
_SEEN = 4.0
"""Ratio of that square of a rest to that of white noise from which the rest moves: one quiet rest in 400 is beyond."""
_OF_THE_WAY = 0.65
"""Square of a way that oscillates about its mean, as a share of that median about the chord: 1 / 1.54 for sines of two
periods and more in a rest, each axis at its own rate (4000 draws)."""


class Sway(NamedTuple):
    """How far an IMU moves about its mean at rest, beyond noise, one sigma."""

    angle: Floats
    """rad, shape (k,)."""
    speed: Floats
    """m/s, shape (k,)."""


def relaxed(recording: Recording) -> tuple[StaticIntervals, ...]:
    """Find the rests at every step, those of lower steps among those of higher ones; equal steps once.

    Returns
    -------
    tuple of StaticIntervals
        One at least; the noise is that of the quietest.
    """
    found: list[StaticIntervals] = []
    for step in STEPS:
        try:
            rests = detect_static(recording, step)
        except DataError:
            if step == STEPS[-1] and not found:
                raise
            continue
        grown = _grown(found[-1], rests) if found else rests
        if not found or not _same(grown, found[-1]):
            found.append(grown)
    return tuple(found)


def _same(a: StaticIntervals, b: StaticIntervals) -> bool:
    return len(a) == len(b) and bool(np.all(a.first == b.first) and np.all(a.last == b.last))


def _grown(quiet: StaticIntervals, more: StaticIntervals) -> StaticIntervals:
    """Add rests of a higher step; where a quieter piece is most of one, the piece stays."""
    kept = list(zip(quiet.first.tolist(), quiet.last.tolist(), strict=True))
    for a, b in zip(more.first.tolist(), more.last.tolist(), strict=True):
        inside = [(c, d) for c, d in kept if c < b and a < d]
        if sum(d - c for c, d in inside) < _WHOLE * (b - a):
            kept = [one for one in kept if one not in inside] + [(a, b)]
    first, last = np.array(sorted(kept)).T
    return StaticIntervals(first, last, quiet.gyro_white_noise, quiet.accel_white_noise)


def sway(recording: Recording, rests: StaticIntervals) -> Sway:
    """Measure how far the IMU moves about its mean at each rest; zero where noise explains it.

    The integral of white noise about its chord is a Brownian bridge. The median over time stands for the rest: a nudge
    comes back and leaves it as it is.

    Parameters
    ----------
    rests : StaticIntervals
        k rests.
    """
    dt = recording.interval_s
    out = np.zeros((2, len(rests)))
    pairs = ((recording.omega_ib_b, rests.gyro_white_noise), (recording.f_ib_b, rests.accel_white_noise))
    for triad, (values, noise) in enumerate(pairs):
        for k, (a, b) in enumerate(zip(rests.first, rests.last, strict=True)):
            way = np.cumsum(values[a:b] - values[a:b].mean(axis=0), axis=0) * dt
            square = float(np.median(np.mean(way**2, axis=1)))
            white = _BRIDGE * noise**2 * (b - a) * dt
            out[triad, k] = np.sqrt(_OF_THE_WAY * (square - white)) if square > _SEEN * white else 0.0
    return Sway(out[0], out[1])


def usual_scatter(values: Floats, rests: StaticIntervals, interval_s: float) -> Floats:
    """Variance within a window, the median over each rest.

    Parameters
    ----------
    values : ndarray, shape (n, 3)
        Rate or force (rad/s or m/s^2).
    rests : StaticIntervals
        k rests.
    interval_s : float
        Of the samples (s).

    Returns
    -------
    ndarray, shape (k,)
        Sum of the axes (square of the unit of `values`).
    """
    width = max(round(WINDOW_S / interval_s), 4)
    out = []
    for a, b in zip(rests.first.tolist(), rests.last.tolist(), strict=True):
        size = min(width, b - a)
        windows = values[a : a + (b - a) // size * size].reshape(-1, size, 3)
        out.append(float(np.median(np.var(windows, axis=1).sum(axis=1))))
    return np.array(out)
