"""The samples of one even clock among those of several: what two publishers send is mixed, the clock of each is even.

The interval is the shortest distance at which nearly every sample of the stream has a successor. A clock of that
interval is then followed from sample to sample; of two samples at one of its times it takes the one that is nearer in
time and in value; motion that both show does not count.
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.probability import GAUSS_MAD

_PROBE = 2000
"""Number of samples in which the clock is sought: some seconds, with no drift of the clock."""
_STARTS = 3
"""Number of first samples that are tried as the first of the clock: one or two may be strays."""
_LAGS = 4
"""Number of samples up to the successor at most: two publishers of rates 1 to 3 are told."""
_BIN = 0.03
"""Width of a class of distances (mean steps of all samples): jitter fills several, two clocks are farther apart."""
_WIDTH = 0.1
"""Distance from the most frequent one (1) within which the interval is a median: jitter, but no other clock."""
_FREQUENT = 0.15
"""Share of the samples (1) with a successor at the distance of an interval, at least: jitter spreads the others."""
_FASTEST = 0.8
"""Ratio of an interval to the mean step of all samples at least: no stream has more samples than all have."""
_COVERED = 0.9
"""Share of the times of the clock that have a sample at least: a link that loses more is not even."""
_GATE = 0.35
"""Largest distance of a sample from its time (intervals): beyond lies the half way to the next time, and jitter."""
_TIGHT = 8.0
"""Ratio to the jitter of that distance, where the jitter is small: chance ends below."""
_LEAST_JITTER = 0.01
"""Least jitter (intervals) that is counted with: stamps are rounded."""
_EXACT = 0.003
"""Least jitter (intervals) where two samples are at one time: the nearer one is nearer by more than rounding."""
_LOST = 30
"""Number of times without a sample after which the clock begins anew: a gap, or a step of the clock."""
_LOST_BESIDE = 10_000
"""The same number beside another stream, whose samples go on in a gap: clocks of 1e-5 keep their place so long."""
_BESIDE = 0.3
"""Number of samples beside each of the clock from which there is another stream: strays are fewer."""
_FRESH = 20
"""Number of intervals for which the distance of two samples at one time tells the next two: attitudes last longer."""
_MOST = 50.0
"""Weight of the values (chi-square) at most: of two samples far apart in time the time tells, whatever moves."""
_PHASE_GAIN, _INTERVAL_GAIN = 0.1, 0.002
"""Share of the deviation of a sample by which clock and interval follow: the mean of tens of them."""
_VALUE_GAIN, _TREND_GAIN = 0.3, 0.05
"""Share of the deviation of a value by which its prediction and its trend follow: turns begin within such a time."""


def find_clock(ns: Ints, omega: Floats, force: Floats) -> Ints | None:
    """Find the samples of the densest even stream.

    Parameters
    ----------
    ns : ndarray of int, shape (n,)
        Stamps (ns), ascending; several samples may have one.
    omega, force : ndarray, shape (n, 3)
        In any unit, finite.

    Returns
    -------
    ndarray of int, shape (n,), or None
        Intervals from the first sample of the clock to each of the samples, -1 for samples of no time of the clock;
        None where no stream is even.
    """
    if not len(ns):
        return None
    t = (ns - ns[0]) * 1e-9
    few = slice(0, _PROBE)
    weights = _weight(omega[few]), _weight(force[few])
    for apart in _distances(t[few]):
        clock = _Clock(t[few], omega[few], force[few], weights, apart)
        if clock.covered >= _COVERED:
            time = clock.time[0], max(clock.time[1], clock.scatter_s / clock.interval)
            return _follow(t, omega, force, weights, clock.start, clock.interval, time)
    return None


class _Clock:
    """A clock of about the interval of some distances, in the first samples.

    Attributes
    ----------
    covered : float
        Share of its times that have a sample.
    start : int
        Row of its first sample: of the first ones that which gives it most.
    interval, scatter_s : float
        Interval, and scatter of the samples about their times (s).
    time : (float, float)
        Largest distance of a sample from its time, and jitter (intervals).
    """

    def __init__(self, t: Floats, omega: Floats, force: Floats, weights: tuple[Floats, Floats], apart: Floats) -> None:
        self.covered, self.start, self.scatter_s = 0.0, 0, np.inf
        self.interval = float(np.median(apart))
        # A distance has the jitter of two samples.
        jitter = GAUSS_MAD * float(np.median(np.abs(apart - self.interval))) / np.sqrt(2.0) / self.interval
        self.time = (min(_TIGHT * max(jitter, _LEAST_JITTER), _GATE), max(jitter, _EXACT))
        first = self.interval
        for start in range(min(_STARTS, len(t))):
            slot = _follow(t, omega, force, weights, start, first, self.time)
            share = np.count_nonzero(slot >= 0) / (slot.max() + 1)
            if share > self.covered + 0.5 * (1.0 - _COVERED):
                self.covered, self.start = share, start
                self._measure(t, slot)

    def _measure(self, t: Floats, slot: Ints) -> None:
        rows = np.flatnonzero(slot >= 0)
        if len(rows) > _STARTS:
            interval, offset = np.polyfit(slot[rows], t[rows], 1)
            self.interval = float(interval)
            self.scatter_s = GAUSS_MAD * float(np.median(np.abs(t[rows] - offset - interval * slot[rows])))


def _distances(t: Floats) -> list[Floats]:
    """Distances that many samples have to one of their next (s), by the interval that they show, the shortest first."""
    if len(t) <= 2 * _LAGS:
        return []
    lag = min(10 * _LAGS, len(t) // 2)
    mean = float(np.median(t[lag:] - t[:-lag])) / lag
    if not mean > 0.0:
        return []
    apart = np.concatenate([t[j:] - t[:-j] for j in range(1, _LAGS + 1)])
    apart = apart[(apart > _FASTEST * mean) & (apart < 2.0 * _LAGS * mean)]
    count = np.bincount(np.rint(apart / (_BIN * mean)).astype(np.int64), minlength=5)
    count = np.convolve(count, np.ones(5, dtype=np.int64), mode="same")
    highest = np.lib.stride_tricks.sliding_window_view(np.pad(count, 2), 5).max(axis=1)
    frequent = np.flatnonzero((count >= _FREQUENT * len(t)) & (count >= highest))
    peaks = frequent * _BIN * mean
    return [apart[np.abs(apart - peak) <= _WIDTH * peak] for peak in peaks]


def _weight(x: Floats) -> Floats:
    """One over twice the variance of the noise of each axis, shape (3,): of the quietest distance of few samples."""
    apart = [np.median(np.abs(x[j:] - x[:-j]), axis=0) for j in range(1, min(_LAGS, len(x) - 1) + 1)]
    noise = GAUSS_MAD * np.min(apart, axis=0) if apart else np.zeros(3)
    return np.where(noise > 0.0, 1.0 / np.where(noise > 0.0, noise, 1.0) ** 2, 0.0)


@compiled
def _follow(
    t: Floats,
    omega: Floats,
    force: Floats,
    weights: tuple[Floats, Floats],
    start: int,
    interval: float,
    time: tuple[float, float],
) -> Ints:
    """Follow a clock from a sample on and count its intervals, -1 for samples of none; `time` is (gate, jitter)."""
    slot = np.full(t.shape[0], -1, dtype=np.int64)
    slot[start] = 0
    # Value of the clock's samples, its trend, and the distance of other samples at the same times.
    value, trend, apart = np.zeros(6), np.zeros(6), np.zeros(6)
    value[:3], value[3:] = omega[start], force[start]
    at, done, beside, pair = t[start], 0, 0.0, -_FRESH - 1
    # The best sample for the next time, how many intervals ahead it is, how late, and the one that it was preferred to.
    waiting, ahead, off, other, others = -1, 0, 0.0, -1, 0
    for k in range(start + 1, t.shape[0]):
        steps = int(np.rint((t[k] - at) / interval))
        if waiting >= 0 and steps > ahead:
            slot[waiting] = done + ahead
            at += ahead * interval + _PHASE_GAIN * off
            interval += _INTERVAL_GAIN * off / ahead
            done += ahead
            beside += _VALUE_GAIN * (others / ahead - beside)
            for c in range(6):
                new = _value(omega, force, waiting, c) - value[c] - ahead * trend[c]
                value[c] += ahead * trend[c] + _VALUE_GAIN * new
                trend[c] += _TREND_GAIN * new / ahead
            if other >= 0:
                gain = _VALUE_GAIN if done - pair <= _FRESH else 1.0
                for c in range(6):
                    apart[c] += gain * (_value(omega, force, other, c) - _value(omega, force, waiting, c) - apart[c])
                pair = done
            waiting, other, others = -1, -1, 0
            steps = int(np.rint((t[k] - at) / interval))
        late = t[k] - at - steps * interval
        if steps < 1 or (abs(late) > time[0] * interval and (waiting >= 0 or steps <= _patience(beside))):
            others += 1
            continue
        if abs(late) > time[0] * interval:
            at, late = t[k] - steps * interval, 0.0
        if waiting < 0:
            waiting, ahead, off = k, steps, late
            continue
        others += 1
        if done - pair <= _FRESH:
            better = _nearer(omega, force, weights, (k, waiting), 2.0 * apart, 0.0)
        else:
            better = _nearer(omega, force, weights, (k, waiting), -2.0 * (value + steps * trend), 1.0)
        better = min(max(better, -_MOST), _MOST) - (late**2 - off**2) / (time[1] * interval) ** 2
        other = waiting if better > 0.0 else k
        if better > 0.0:
            waiting, ahead, off = k, steps, late
    if waiting >= 0:
        slot[waiting] = done + ahead
    return slot


@compiled
def _nearer(
    omega: Floats, force: Floats, weights: tuple[Floats, Floats], rows: tuple[int, int], apart: Floats, own: float
) -> float:
    """Say by how much (chi-square) the first of two samples fits better than the second.

    Against the first speaks its difference from the second times `apart`, and `own` times the sum of both.
    """
    total = 0.0
    for c in range(6):
        x, y = _value(omega, force, rows[0], c), _value(omega, force, rows[1], c)
        total -= (x - y) * (apart[c] + own * (x + y)) * (weights[0][c] if c < 3 else weights[1][c - 3])
    return total


@compiled
def _value(omega: Floats, force: Floats, row: int, c: int) -> float:
    """Return one of the six numbers of a sample."""
    return float(omega[row, c]) if c < 3 else float(force[row, c - 3])


@compiled
def _patience(beside: float) -> int:
    """Return the number of times without a sample after which the clock begins anew."""
    return _LOST if beside < _BESIDE else _LOST_BESIDE
