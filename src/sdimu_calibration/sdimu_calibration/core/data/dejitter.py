"""Removal of jitter from stamps of even sampling.

An IMU samples evenly and integrates continuously; a driver that stamps messages on arrival adds the delays of its
computer. A rate times a jittering interval is a wrong angle. The count of the samples is the better clock, as long as
the jitter is below a quarter of an interval; slow drift of the one clock against the other is kept.

Beyond that the samples are asked. Where rate or force changes, a sample that was taken late shows that of the later
time. If the values follow an even clock and not their stamps, and the deviations are white, the jitter is the host's.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.data.blocks import pieces
from sdimu_calibration.core.note import Note, Topic
from sdimu_calibration.core.recording import Recording

_DOUBT = 0.25
"""Largest jitter that is removed, a share of the interval: beyond it missing samples cannot be counted."""
_FOLLOWS = 0.02
"""Share of the deviation of a stamp by which the clock follows it: the mean of a hundred stamps."""
_MOST = 0.12
"""Largest jitter (rms) that samples are asked about, a share of the interval: four of it are half an interval."""
_WHITE = 0.2
"""Largest correlation of neighbouring deviations (1): delays of a host are new with each message."""
_DECIDED = 0.1
"""Largest sigma of the share of the jitter that samples follow: five of it are between the two clocks."""
_SIDE = 4
"""Number of samples to each side over which the change of the rate is taken: longer than a sample's noise."""
_CHANGES = 0.2
"""Share of the largest change of the rate from which a sample is asked: the beginnings and ends of turns."""
_FEWEST = 50
"""Number of samples in such places at least: a second of turns that begin."""
_LEAST = 2e-3
"""Least jitter (rms) that is removed, a share of the interval: below it is the rounding of stamps."""
_DRIFT_S = 20.0
"""Time over which the drift of the clocks is smoothed (s): clocks drift more slowly."""


def dejittered(recording: Recording) -> Recording:
    """Replace jittering stamps by even ones, with a note.

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
    measured = _in_words(rms, interval)
    if np.abs(jitter).max() > _DOUBT * interval or (steps < 1.0).any():
        found = _told_by_samples(recording)
        if found is None:
            note = f"{measured}: too much to tell even sampling from missing samples; the stamps stay as they are"
            return _noted(recording, recording.t, note)
        measured = _in_words(float(np.sqrt(np.mean(found**2))), interval)
        note = f"{measured}: samples of turns follow an even clock and not the stamps, so their count is the clock"
        return _noted(recording, t - found, note)
    even = t - jitter
    note = f"{measured}: samples are taken as even, and their count as the clock"
    return _noted(recording, even, note)


def _noted(recording: Recording, t: Floats, note: str) -> Recording:
    """Give the samples other times, and say so."""
    return replace(recording, t=t, notes=(*recording.notes, Note(note, Topic.JITTER)))


def _in_words(rms: float, interval: float) -> str:
    return f"header stamps jitter by {rms * 1e3:.3g} ms (rms, {rms / interval:.1%} of the interval)"


def _told_by_samples(recording: Recording) -> Floats | None:
    """Ask the samples whether an even clock took them.

    Parameters
    ----------
    recording : Recording
        n samples.

    Returns
    -------
    ndarray, shape (n,), or None
        Stamps less the even clock (s); None where the count is not certain, or nothing speaks for an even clock.
    """
    t, interval = recording.t, recording.interval_s
    count = _counted(t, interval)
    if (np.diff(count) < 1.0).any():
        return None
    slope, offset = np.polyfit(count, t, 1)
    left = t - (offset + slope * count)
    jitter = left - _smooth(left, max(round(_DRIFT_S / interval), 1))
    rms = float(np.sqrt(np.mean(jitter**2)))
    if rms > _MOST * interval or np.abs(jitter).max() > 0.5 * interval:
        return None
    if abs(float(jitter[1:] @ jitter[:-1])) > _WHITE * float(jitter @ jitter):
        return None
    both = [_share_followed(values, jitter, interval) for values in (recording.omega_ib_b, recording.f_ib_b)]
    share, weight = (np.array(v) for v in zip(*((s, sigma**-2.0) for s, sigma in both), strict=True))
    if not weight.sum() > _DECIDED**-2.0 or share @ weight / weight.sum() > 0.5 - 2.0 * _DECIDED:
        return None
    return np.asarray(jitter)


@compiled
def _counted(t: Floats, interval: float) -> Floats:
    """Count the intervals up to each sample by a clock that follows the stamps slowly, shape (n,).

    A step between two stamps has the jitter of both and may be rounded wrongly for good; a stamp against the clock of
    those before it has its own alone.
    """
    count = np.zeros(t.shape[0])
    clock = t[0]
    for k in range(1, t.shape[0]):
        steps = np.rint((t[k] - clock) / interval)
        count[k] = count[k - 1] + steps
        clock += steps * interval
        clock += _FOLLOWS * (t[k] - clock)
    return count


def _share_followed(values: Floats, jitter: Floats, interval: float) -> tuple[float, float]:
    """Share of the jitter that the samples follow: 1 where the stamps say when they were taken, 0 for an even clock.

    A sample between two others is off their mean by the slope of the values times what its interval is off theirs.

    Returns
    -------
    share, sigma : float
        1; sigma is infinite where the values hardly change.
    """
    middle = 0.5 * (jitter[1:] + jitter[:-1])
    apart = middle[1:-1] - 0.5 * (middle[:-2] + middle[2:])
    off = values[2:-1] - 0.5 * (values[1:-2] + values[3:])
    change = np.zeros_like(off)
    change[_SIDE:-_SIDE] = (values[2 + 2 * _SIDE : -1] - values[2 : -1 - 2 * _SIDE]) / (2 * _SIDE * interval)
    expected = change * apart[:, None]
    # Where nothing changes the product is noise times jitter and says nothing.
    large = np.abs(change) > _CHANGES * float(np.abs(change).max(initial=0.0))
    x, y = expected[large], off[large]
    total = float(x @ x)
    if len(x) < _FEWEST or not total > 0.0:
        return 0.0, float("inf")
    share = float(x @ y) / total
    return share, float(np.sqrt(np.mean((y - share * x) ** 2) / total))


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
