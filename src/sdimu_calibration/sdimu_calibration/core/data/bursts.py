"""Stamps that come in bursts: a link (Bluetooth, USB) that delivers samples by the packet stamps them as they arrive.

Such stamps are no sample times: within a packet they differ by nothing, between packets by its whole length. The count
of the samples is the clock, and its rate that of the stamps over minutes. A pause of several packets is a gap; less is
a packet that came late, and no sample is lost by it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints

_BLOCK = 200
"""Number of samples over which the mean interval is taken: longer than a packet, shorter than a recording."""
_TOGETHER = 0.3
"""Share of the mean interval below which two samples came together: jitter that can be evened leaves three quarters."""
_OFTEN = 0.25
"""Share of samples that came together with the one before from which stamps come in bursts: a busy computer delays
fewer."""
_PAUSE = 4.0
"""Ratio of a step to the usual wait for a packet from which it is a gap: a link that is asked again takes two or
three."""
_USUAL = 0.98
"""Share of the steps that are no longer than the usual wait for a packet: retries are the others."""


@dataclass(frozen=True)
class Bursts:
    """Stamps in bursts, and what they mean."""

    ns: Ints
    """Even stamps by the count of the samples (ns), shape (n,)."""
    rate_hz: float
    wait_s: float
    """Usual wait for a packet (s)."""

    def __str__(self) -> str:
        """Say it in a line."""
        return (
            f"stamps come in bursts, {self.wait_s * 1e3:.3g} ms apart: samples are taken as even at "
            f"{self.rate_hz:.5g} Hz, and their count as the clock"
        )


def find_bursts(ns: Ints) -> Bursts | None:
    """Even out stamps that come in bursts; None when they do not.

    Parameters
    ----------
    ns : ndarray of int64, shape (n,)
        Stamps (ns) in the order of arrival.
    """
    step = np.diff(ns)
    if len(step) < _BLOCK or (step < 0).any():
        return None
    whole = len(step) // _BLOCK * _BLOCK
    mean = float(np.median(step[:whole].reshape(-1, _BLOCK).mean(axis=1)))
    if np.mean(step < _TOGETHER * mean) < _OFTEN:
        return None
    wait = float(np.quantile(step[step > mean], _USUAL))
    pieces = np.split(np.arange(len(ns)), np.flatnonzero(step > _PAUSE * wait) + 1)
    interval = _interval(ns, max(pieces, key=len), np.append(step > _TOGETHER * mean, True))
    even = np.concatenate([_even(ns[rows], interval) for rows in pieces])
    return Bursts(np.maximum.accumulate(even), 1e9 / interval, wait * 1e-9)


def _interval(ns: Ints, rows: Ints, ends: Bools) -> float:
    """Interval of the samples (ns) of an unbroken piece: the slope over their count of the last stamps of packets."""
    count = np.flatnonzero(ends[rows])
    at = (ns[rows] - ns[rows[0]])[count].astype(np.float64)
    return float(np.polyfit(count, at, 1)[0])


def _even(ns: Ints, interval: float) -> Ints:
    """Stamps of one piece at even intervals that end, in the mean, where they were."""
    count = np.arange(len(ns))
    late: Floats = (ns - ns[0]) - interval * count
    return np.asarray(ns[0] + np.rint(late.mean() + interval * count).astype(np.int64))
