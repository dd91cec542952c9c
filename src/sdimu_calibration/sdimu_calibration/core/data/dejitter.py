"""Removal of jitter from stamps of even sampling.

An IMU samples evenly and integrates continuously; a driver that stamps messages on arrival adds the delays of its
computer. A rate times a jittering interval is a wrong angle. The count of the samples is the better clock, as long as
the jitter is below a quarter of an interval; slow drift of the one clock against the other is kept.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.data.blocks import pieces
from sdimu_calibration.core.recording import Recording

_DOUBT = 0.25
"""Largest jitter that is removed, a share of the interval: beyond it missing samples cannot be counted."""
_LEAST = 2e-3
"""Least jitter (rms) that is removed, a share of the interval: below it is the rounding of stamps."""
_DRIFT_S = 20.0
"""Time over which the drift of the clocks is smoothed (s): clocks drift more slowly."""


def dejittered(recording: Recording) -> Recording:
    """Replace jittering stamps by even ones, with a note.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    Recording
        The same object when the stamps are even; with a note and its own stamps when they are too uneven.
    """
    t = recording.t
    interval = recording.interval_s
    if _plainly_even(t, interval):
        return recording
    steps = np.rint(np.diff(t) / interval)
    count = np.concatenate([[0.0], np.cumsum(steps)])
    slope, offset = np.polyfit(count, t, 1)
    left = t - (offset + slope * count)
    drift = _smooth(left, max(round(_DRIFT_S / interval), 1))
    jitter = left - drift
    rms = float(np.sqrt(np.mean(jitter**2)))
    if rms < _LEAST * interval:
        return recording
    measured = f"header stamps jitter by {rms * 1e3:.3g} ms (rms, {rms / interval:.1%} of the interval)"
    if np.abs(jitter).max() > _DOUBT * interval or (steps < 1.0).any():
        note = f"{measured}: too much to tell even sampling from missing samples; the stamps stay as they are"
        return replace(recording, notes=(*recording.notes, note))
    even = t - jitter
    note = f"{measured}: samples are taken as even, and their count as the clock"
    return replace(recording, t=even, notes=(*recording.notes, note))


def _plainly_even(t: Floats, interval: float) -> bool:
    """Whether every step is so near the interval that no sum of them over the smoothing time is jitter.

    Over the h samples to each side of its mean a stamp is off by less than the sum of what their steps are off.
    """
    half = max(round(_DRIFT_S / interval), 1)
    return all(
        float(np.abs(np.diff(t[rows]) - interval).max(initial=0.0)) * half < _LEAST * interval
        for rows in pieces(len(t) - 1, 1)
    )


def _smooth(values: Floats, half: int) -> Floats:
    """Mean over `half` samples to each side, as far as there are any, shape (n,)."""
    total = np.concatenate([[0.0], np.cumsum(values)])
    at = np.arange(len(values))
    width = np.minimum(np.minimum(at, len(values) - 1 - at), half)
    return np.asarray((total[at + width + 1] - total[at - width]) / (2 * width + 1))
