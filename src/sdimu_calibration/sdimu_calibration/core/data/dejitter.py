"""Stamps that jitter about even sampling: the clock behind them, not the moment a computer read it.

An IMU samples evenly and integrates all the time; a driver that stamps messages as they arrive adds the delays of its
computer. A rate times a jittering interval is an angle that nobody turned. The samples' own count is the better clock,
as long as no more than a quarter of an interval is in doubt; slow drift of the one clock against the other is kept.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.recording import Recording

_DOUBT = 0.25
"""Jitter beyond this share of the interval makes it doubtful which samples are missing."""
_LEAST = 2e-3
"""Jitter (rms) below this share of the interval is the rounding of stamps."""
_DRIFT_S = 20.0
"""Clocks drift against each other over longer than this."""


def dejittered(recording: Recording) -> Recording:
    """Replace jittering stamps by even ones, and say so.

    Returns
    -------
    Recording
        The same object when the stamps are even, or too uneven for anybody to know; the latter with a note.
    """
    t = recording.t
    interval = recording.interval_s
    steps = np.rint(np.diff(t) / interval)
    count = np.concatenate([[0.0], np.cumsum(steps)])
    slope, offset = np.polyfit(count, t, 1)
    left = t - (offset + slope * count)
    drift = _smooth(left, max(round(_DRIFT_S / interval), 1))
    jitter = left - drift
    rms = float(np.sqrt(np.mean(jitter**2)))
    if rms < _LEAST * interval:
        return recording
    told = f"header stamps jitter by {rms * 1e3:.3g} ms (rms, {rms / interval:.1%} of the interval)"
    if np.abs(jitter).max() > _DOUBT * interval or (steps < 1.0).any():
        note = f"{told}: too much to tell even sampling from missing samples; used as they are"
        return replace(recording, notes=(*recording.notes, note))
    even = t - jitter
    note = f"{told}: samples are taken to be even, and their count for the clock"
    return replace(recording, t=even, notes=(*recording.notes, note))


def _smooth(values: Floats, half: int) -> Floats:
    """Mean over `half` samples to each side, as far as there are any, shape (n,)."""
    total = np.concatenate([[0.0], np.cumsum(values)])
    at = np.arange(len(values))
    width = np.minimum(np.minimum(at, len(values) - 1 - at), half)
    return np.asarray((total[at + width + 1] - total[at - width]) / (2 * width + 1))
