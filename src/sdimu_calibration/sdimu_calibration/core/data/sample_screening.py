"""Samples that are no measurement: a number that stands still, a reading at the stop of its range, a single spike.

Such a sample is taken away, as if it had been lost: what the gap means is then decided in one place (`gaps`). Each test
is a probability under continuous noise, learned from the channel itself, so that no IMU needs limits of its own:
fewer than one sound test in a thousand loses a sample to it. Channels whose counts are coarser than their
noise repeat numbers by nature; for them a run must be as long as their own repetitions make improbable.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.data.blocks import let_go, pieces
from sdimu_calibration.core.plain_text import counted
from sdimu_calibration.core.probability import GAUSS_MAD
from sdimu_calibration.core.recording import DataFault, Recording
from sdimu_calibration.core.side_by_side import side_by_side

R = TypeVar("R")

CHANNELS = tuple(f"{triad} {axis}" for triad in ("gyro", "accelerometer") for axis in "xyz")
_FALSE_ALARM = 1e-3
"""Probability of a false alarm in a recording, a channel: one sound recording in a thousand."""
_BLOCK = 500
"""Number of samples in a block for the share of repeated numbers: the median drops the blocks of a stuck stretch."""
_REPEATS = 0.5
"""Share of repeated numbers from which the test for a stuck channel is skipped: no noise, or resolution too coarse."""
_LEAST_AT_END = 3
"""Least number of readings at the extreme number that is saturation: continuous noise does not repeat its extreme."""
_PERFECT = 1e-7
"""Ratio of noise to largest reading below which a channel has no noise: a navigation-grade gyro on a table has 5e-6."""
_SPIKE = 8.0
"""Ratio of a second difference to its sigma from which it is a spike: a million Gaussian samples reach 6.2."""
_ALONE = 0.25
"""Largest ratio of the second differences around a spike to its own: more is motion."""
_AROUND = np.r_[-12:-2, 3:13]
_OF_ANOTHER = 3
"""Number of large second differences around a spike that are ignored: another spike makes three, a shock more."""
_ROUNDS = 4
"""Largest number of searches for spikes: a spike may hide another beside it."""
_WINDOW = 20
"""Number of samples in a median of the roughness: a corner of the motion is one sample."""
_WILD = 4.0
"""Ratio to the usual roughness from which a window is disturbed: white noise reaches 2.2 in an hour."""
_RARE = 0.02
"""Largest share of rough windows that is a fault: more is a property of the recording, such as a table that shakes."""
_EDGE = 3
"""Number of samples at the edge of a window that say what its rate was: one may be a spike."""
_ONE_SIDED = 0.9
"""Ratio of the sum of changes to the sum of their sizes from which they go to one side: white noise reaches 0.8."""
_TURN_BEGINS = 10.0
"""Ratio of a change of rate to the usual one from which it may be a turn: noise reaches 7."""
_TOGETHER = 2_000_000
"""Number of samples to which channels are looked at side by side: longer recordings lie in a file, not in memory."""


def sound(recording: Recording) -> tuple[Recording, tuple[DataFault, ...]]:
    """Take away the samples that are no measurement.

    Parameters
    ----------
    recording : Recording
        In the order of its stamps.

    Returns
    -------
    recording : Recording
        The same object when nothing is wrong.
    faults : tuple of DataFault
    """
    bad = np.zeros(len(recording.t), dtype=bool)
    found: dict[str, list[tuple[str, Ints]]] = {}
    for name, tested in _on_channels(recording, _tested):
        for kind, rows in tested.items():
            if len(rows):
                found.setdefault(kind, []).append((name, rows))
                bad[rows] = True
    faults = tuple(_fault(kind, where, recording.t) for kind, where in found.items())
    return (taken_away(recording, bad), faults) if bad.any() else (recording, ())


def taken_away(recording: Recording, bad: Bools) -> Recording:
    """Take samples away.

    Parameters
    ----------
    bad : ndarray, shape (n,)
        True for a sample to be taken away.

    Returns
    -------
    Recording
        With these samples counted as rejected, and their times as gaps.
    """
    keep = ~bad
    return replace(
        recording,
        t=recording.t[keep],
        omega_ib_b=recording.omega_ib_b[keep],
        f_ib_b=recording.f_ib_b[keep],
        rejected=recording.rejected + int(bad.sum()),
    )


def _on_channels(recording: Recording, work: Callable[[Floats], R]) -> list[tuple[str, R]]:
    """Do some work on the numbers (n,) of each channel that has noise; return it with the name of the channel."""

    def one(channel: int) -> tuple[str, R] | None:
        triad = recording.omega_ib_b if channel < 3 else recording.f_ib_b
        x = np.empty(len(triad))
        for rows in pieces(len(triad)):
            x[rows] = triad[rows, channel % 3]
            let_go(triad)
        return None if _noiseless(x) else (CHANNELS[channel], work(x))

    # Two channels of a long recording at a time would need twice the memory.
    each = side_by_side if len(recording.t) <= _TOGETHER else map
    return [done for done in each(one, range(len(CHANNELS))) if done is not None]


def _tested(x: Floats) -> dict[str, Ints]:
    """Rows of a channel that are no measurement, by kind of fault."""
    return {kind: test(x) for kind, test in _TESTS.items()}


_TEXT = {
    "stuck": ("shows one number", "show one number"),
    "saturated": ("stands at the end of its range", "stand at the end of their range"),
    "spike": ("jumps away and back", "jump away and back"),
}


def _fault(kind: str, where: list[tuple[str, Ints]], t: Floats) -> DataFault:
    """One line for a fault of any number of channels."""
    rows = np.unique(np.concatenate([at for _name, at in where]))
    first, last = float(t[rows[0]]), float(t[rows[-1]])
    places = f"{first:.1f} s" if last - first < 1.0 else f"{first:.1f} to {last:.1f} s"
    names = [name for name, _at in where]
    who = " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
    line = f"{who} {_TEXT[kind][len(names) > 1]} in {counted(len(rows), 'sample')} ({places}), taken as missing"
    return DataFault(kind, line, len(rows), first, last)


def _repetition(same: Bools) -> float:
    """Share of samples that repeat the one before, blind to stretches that are stuck: a median over blocks."""
    whole = len(same) // _BLOCK
    if whole < 3:
        return float(same.mean()) if len(same) else 1.0
    return float(np.median(same[: whole * _BLOCK].reshape(whole, _BLOCK).mean(axis=1)))


def _runs(same: Bools) -> tuple[Ints, Ints]:
    """First sample and length of every run of equal numbers of two samples or more."""
    edge = np.diff(np.concatenate([[0], same.view(np.int8), [0]]))
    first = np.flatnonzero(edge == 1)
    return first, np.flatnonzero(edge == -1) - first + 1


def _stuck(x: Floats) -> Ints:
    """Find runs of one number that are too long for the channel."""
    none = np.empty(0, dtype=np.int64)
    n = len(x)
    same = x[1:] == x[:-1]
    if n < 3 or not same.any():
        return none
    share = max(_repetition(same), 1.0 / n)
    if share > _REPEATS or _counts(x):
        return none
    first, length = _runs(same)
    known, share = _long_runs(length, share)
    # n chances to begin, each further repetition as probable as `share`.
    improbable = known + math.ceil(math.log(_FALSE_ALARM / n) / math.log(share))
    long = length >= max(improbable, 3)
    # The first number of a run is a measurement, the others repeat it.
    rows = [np.arange(f + 1, f + k) for f, k in zip(first[long], length[long], strict=True)]
    return np.concatenate(rows) if rows else none


def _long_runs(length: Ints, share: float) -> tuple[int, float]:
    """Length from which runs of one number get longer by chance, and the probability of each further repetition.

    A coarse channel whose reading moves slowly (a base that rocks) repeats a number more often where it has repeated
    it already: half of its longer runs go on for the median of what they have beyond `_LONGER`. A few runs that are
    stuck do not move that median.
    """
    more = length[length > _LONGER] - _LONGER
    if share < _COARSE or not len(more):
        return 1, share
    return _LONGER, max(share, 0.5 ** (1.0 / float(np.median(more))))


_COARSE = 0.2
"""Share of repeated numbers from which a channel is coarse: its counts are three sigmas of its noise and more."""
_LONGER = 4
"""Length of a run (samples) beyond which it says how runs go on: shorter ones are the noise between two counts."""


def _counts(x: Floats) -> bool:
    """Whether a channel counts pulses that are coarser than its noise.

    A counter repeats a number for as long as its remainder takes to make one more pulse: its runs are no chance.
    """
    steps = np.abs(np.diff(x))
    # Multiples of a pulse in floating point differ by rounding.
    steps = steps[steps > _ROUNDING * float(np.abs(x).max())]
    return bool(len(steps)) and float(np.mean(steps < 1.5 * steps.min())) > _REPEATS


_ROUNDING = 1e-9
"""Ratio of a step to the largest reading below which it is rounding: pulses are larger."""


def _saturated(x: Floats) -> Ints:
    """Find readings that stand at the largest or smallest number of a channel that else repeats nothing."""
    none = np.empty(0, dtype=np.int64)
    if len(x) < 3 or _repetition(x[1:] == x[:-1]) > 1.0 / _BLOCK or _counts(x):
        return none
    ends = [np.flatnonzero(x == end) for end in (x.max(), x.min())]
    rows = [at for at in ends if len(at) >= _LEAST_AT_END]
    return np.sort(np.concatenate(rows)) if rows else none


def _noiseless(x: Floats) -> bool:
    """Whether a channel has no noise to speak of, as a perfect simulation: what repeats in it is no fault."""
    if len(x) < 3:
        return True
    size = np.abs(x)
    # Most channels have noise by any measure, which no sorting is needed to see.
    if not _mostly_below(x, _PERFECT * float(size.max())):
        return False
    # One reading that is no measurement must not make all others small.
    few = max(len(x) // _BLOCK, _LEAST_AT_END)
    largest = float(np.partition(size, -few)[-few]) or float(size.max())
    return _mostly_below(x, _PERFECT * largest)


def _mostly_below(x: Floats, limit: float) -> bool:
    """Whether the median distance of samples from the line between their neighbours is below a limit."""
    count = len(x) - 2
    # Counting is quicker than a median, which only a tie needs.
    below = 2 * sum(int(np.count_nonzero(_bend(x[rows]) < limit)) for rows in pieces(count, 2))
    return below > count if below != count else float(np.median(_bend(x))) < limit


def _bend(x: Floats) -> Floats:
    """Distance of each sample but the first and the last from the line between its neighbours."""
    return np.asarray(np.abs(x[1:-1] - 0.5 * (x[:-2] + x[2:])))


def _bends(x: Floats) -> Floats:
    """Return the same of all samples, zero at the first and the last."""
    out = np.zeros(len(x))
    for rows in pieces(len(x) - 2, 2):
        out[rows.start + 1 : rows.stop - 1] = _bend(x[rows])
    return out


def _spikes(x: Floats) -> Ints:
    """Find one sample or two far from both neighbours, where these agree and little around is as rough."""
    none = np.empty(0, dtype=np.int64)
    if len(x) < 2 * _BLOCK:
        return none
    rows: Ints | None = None
    # One spike may hide another beside it: what is left is looked through again.
    for _round in range(_ROUNDS):
        left = x if rows is None else x[rows]
        size = _bends(left)
        sigma = GAUSS_MAD * float(np.median(size))
        at = np.union1d(_stand_out(left, size, sigma, 1), _stand_out(left, size, sigma, 2))
        if not len(at):
            break
        rows = np.delete(np.arange(len(x)) if rows is None else rows, at)
    if rows is None:
        return none
    return np.setdiff1d(np.arange(len(x)), rows, assume_unique=True)


def _stand_out(x: Floats, size: Floats, sigma: float, width: int) -> Ints:
    """Find `width` neighbouring samples that all stand off the line between the samples before and after them.

    `size` (n,) is that distance of each sample alone, `sigma` what it usually is.
    """
    if sigma == 0.0:
        return np.empty(0, dtype=np.int64)
    last = len(x) - width - 1
    # Few samples are far from the line; the rest is asked of these alone.
    at = np.concatenate(
        [rows.start + np.flatnonzero(np.abs(_off_line(x, rows, 1, width)) > _SPIKE * sigma) for rows in pieces(last)]
    )
    off = np.abs([_off_line(x, at, j, width) for j in range(1, width + 1)]).min(axis=0)
    good = (off > _SPIKE * sigma) & (np.abs(x[at + width + 1] - x[at]) < 0.5 * off)
    at, off = at[good], off[good]
    beside = np.r_[_AROUND[_AROUND < 0], _AROUND[_AROUND > 0] + width - 1]
    near = np.clip(at[:, None] + 1 + beside, 0, len(x) - 1)
    around = np.sort(size[near], axis=1)[:, -1 - _OF_ANOTHER]
    # The peak of a turn that never runs steady stands off as far as its flanks climb in a sample.
    slope = np.median(np.abs(x[near] - x[np.maximum(near - 1, 0)]), axis=1)
    first = at[np.maximum(around, slope) * width < _ALONE * off] + 1
    return np.unique(first[:, None] + np.arange(width))


def _off_line(x: Floats, at: slice | Ints, place: int, width: int) -> Floats:
    """Distance of sample `place` behind each of `at` from the line between it and the one behind `width` samples."""
    share = place / (width + 1)
    if isinstance(at, slice):
        before, here, after = (x[at.start + j : at.stop + j] for j in (0, place, width + 1))
    else:
        before, here, after = x[at], x[at + place], x[at + width + 1]
    return np.asarray(here - ((1.0 - share) * before + share * after))


_TESTS = {"stuck": _stuck, "saturated": _saturated, "spike": _spikes}


def _medians(rows: Floats) -> Floats:
    """Median of each row without what is not a number; 0 where that is most of it."""
    known = np.isfinite(rows).sum(axis=1)
    # What is no number is sorted behind all others.
    ordered = np.sort(rows, axis=1)
    each = np.arange(len(rows))
    middle = 0.5 * (ordered[each, np.maximum(known - 1, 0) // 2] + ordered[each, known // 2])
    return np.where(known >= rows.shape[1] // 2, middle, 0.0)


def wild(recording: Recording) -> tuple[Floats, Floats, tuple[DataFault, ...]]:
    """Find stretches in which a channel is much rougher than it is else: a loose contact, a disturbed line.

    Their samples stay, because nobody knows that they are wrong, and weigh as much less as they are rougher.

    Parameters
    ----------
    recording : Recording
        Without spikes.

    Returns
    -------
    t : ndarray, shape (k,)
        Middle of each wild window (s).
    excess : ndarray, shape (k,)
        Variance of its noise beyond the usual one, over the usual one, times its length (s).
    faults : tuple of DataFault
    """
    windows = len(recording.t) // _WINDOW
    largest = np.ones(windows)
    faults = []
    # Across missing samples a difference of four is none.
    uneven = np.ones(len(recording.t), dtype=bool)
    interval = recording.interval_s
    for rows in pieces(len(recording.t) - 4, 4):
        t = recording.t[rows]
        uneven[rows.start + 2 : rows.stop - 2] = np.abs(t[4:] - t[:-4] - 4.0 * interval) > interval / 2
    middle = recording.t[_WINDOW // 2 :: _WINDOW][:windows]
    moving: Bools | None = None
    for name, rough in _on_channels(recording, lambda x: _roughness(x, uneven, windows)):
        usual = float(np.median(rough[rough > 0.0])) if rough.any() else 0.0
        at = rough > _WILD * usual
        if usual == 0.0 or not at.any():
            continue
        if moving is None:
            moving = _changing_rate(recording.omega_ib_b[: windows * _WINDOW].reshape(windows, _WINDOW, 3))
            let_go(recording.omega_ib_b)
        at &= ~moving
        if not at.any() or at.mean() > _RARE:
            continue
        ratio = rough / usual
        largest[at] = np.maximum(largest[at], ratio[at])
        t = middle[at]
        text = f"{name} is up to {ratio[at].max():.0f} times rougher than usual at {t[0]:.1f} s"
        more = f" and {np.count_nonzero(np.diff(t) > 1.0)} times more" if np.any(np.diff(t) > 1.0) else ""
        line = f"{text}{more}; its weight is reduced there"
        faults.append(DataFault("wild", line, int(at.sum()) * _WINDOW, float(t[0]), float(t[-1])))
    disturbed = largest > 1.0
    excess = (largest[disturbed] ** 2 - 1.0) * _WINDOW * interval
    return middle[disturbed], excess, tuple(faults)


def _roughness(x: Floats, uneven: Bools, windows: int) -> Floats:
    """Median size of the fourth difference in each window, shape (windows,); `uneven` (n,) are no differences.

    Gravity turns through a body in motion: its fourth difference is nothing beside noise, its second is not.
    """
    out = np.empty(windows)
    for part in pieces(windows):
        begin, end = part.start * _WINDOW, part.stop * _WINDOW
        fourth = np.zeros(end - begin)
        first, last = max(begin, 2), min(end, len(x) - 2)
        y = x[first - 2 : last + 2]
        fourth[first - begin : last - begin] = y[:-4] - 4.0 * y[1:-3] + 6.0 * y[2:-2] - 4.0 * y[3:-1] + y[4:]
        fourth[uneven[begin:end]] = np.nan
        out[part] = _medians(np.abs(fourth).reshape(-1, _WINDOW))
    return out


def _changing_rate(windows: Floats) -> Bools:
    """Say in which windows a turn begins, ends, or both: corners of the motion fill a window where turns are brisk.

    Parameters
    ----------
    windows : ndarray, shape (k, n, 3)
        Rates (rad/s).

    Returns
    -------
    ndarray of bool, shape (k,)
    """
    out = np.zeros(len(windows), dtype=bool)
    for axis in range(3):
        for edge in (slice(_EDGE), slice(-_EDGE, None)):
            out |= _turn_begins(windows[:, :, axis], edge)
    return out


def _turn_begins(windows: Floats, edge: slice) -> Bools:
    """Return the same for one axis (k, n) against one edge of each window."""
    one_sided, largest = np.zeros(len(windows), dtype=bool), np.empty(len(windows))
    sizes = np.empty(windows.shape)
    for part in pieces(len(windows)):
        # Samples first, so that sums go through a window in its order.
        here = np.ascontiguousarray(windows[part].T)
        change = here - here[edge].mean(axis=0)
        size = np.abs(change)
        # A turn goes to one side of where it began, or of where it ended; noise goes to both.
        one_sided[part] = np.abs(change.sum(axis=0)) > _ONE_SIDED * size.sum(axis=0)
        largest[part] = size.max(axis=0)
        sizes[part] = size.T
    usual = float(np.median(sizes, overwrite_input=True)) if len(windows) else 0.0
    return np.asarray(one_sided & (largest > _TURN_BEGINS * usual))
