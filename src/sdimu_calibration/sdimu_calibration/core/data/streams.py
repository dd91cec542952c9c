"""Samples of a second sensor on the topic of the IMU: two publishers, or strays, which names do not tell apart.

Stamps propose and values decide. Samples beside the even clock of the others, or every second sample, are of another
sensor where their values differ from those of their neighbours for good: packets of one sensor do not. Values that are
those of the other stream once more come from a relay of the same sensor.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.data.blocks import all_finite, pieces
from sdimu_calibration.core.data.clock_steps import usual_interval
from sdimu_calibration.core.data.even_clock import find_clock
from sdimu_calibration.core.data.stream_values import (
    ADVICE,
    Samples,
    Split,
    in_blocks,
    of_two_sensors,
    off_clock,
    off_line,
)
from sdimu_calibration.core.plain_text import counted
from sdimu_calibration.core.probability import GAUSS_MAD
from sdimu_calibration.core.recording import NOMINAL_FROM, DataError, nominal_interval_ns

_MISSING = 1.5
"""Length of a step (intervals) from which samples are missing in it: halfway to two intervals."""
_UNEVEN = 0.05
"""Deviation of a step (intervals) from which two clocks are looked for: the stamps of one even clock are rounded."""
_FEW = 400
"""Number of samples from which their mean difference is tested, and in one piece below: they are strays then."""
_GAPS = 0.3
"""Share of steps with samples missing (1) at most: of more the others are distances of two publishers, no intervals."""
_LATE = 100
"""Number of samples in a row with stamps before that of another one from which a clock was set back: a publisher whose
stamps lag is between the samples of the other."""
_SWITCHES = 20
"""Number of changes from one stream to the other, as they arrive, at least: a clock set back makes one."""
_CLEAR = 0.8
"""Ratio of the numbers of samples of two streams (1), at most: then the longer one is that of the test."""
_TURNS = 0.3
"""Change of the specific force (1, of its length) that shows turns: a table tips the IMU by a right angle."""
_MOST_STREAMS = 4
"""Number of streams that are told apart at most: nobody has seen more on one topic."""


def one_stream(ns: Ints, omega: Floats, force: Floats, where: str) -> tuple[Ints | None, tuple[str, ...]]:
    """Keep the samples of one sensor.

    Parameters
    ----------
    ns : ndarray of int, shape (n,)
        Stamps (ns) in the order of arrival.
    omega, force : ndarray, shape (n, 3)
        As recorded.
    where : str
        File and topic, for errors.

    Returns
    -------
    rows : ndarray of int, shape (m,), or None
        Samples to keep in the order of arrival; None keeps all.
    notes : tuple of str
        What was left out, one line each.

    Raises
    ------
    DataError
        Two sensors, and nothing says which of them is tested.
    """
    rows: Ints | None = None
    notes: list[str] = []
    samples = Samples(ns, omega, force, where)
    for _ in range(_MOST_STREAMS):
        split = _split(samples)
        if split is None:
            break
        kept = np.delete(np.arange(len(samples.ns)), split.out)
        rows = kept if rows is None else rows[kept]
        samples = samples[kept]
        notes.append(split.note)
    return rows, tuple(notes)


def _split(samples: Samples) -> Split | None:
    """Tell one stream, or some strays, from the other samples; None where all are of one sensor."""
    if len(samples.ns) <= 2 * NOMINAL_FROM or _clock_set_back(samples.ns):
        return None
    even = _plain_slots(samples.ns)
    if even is not None:
        rows = np.arange(len(samples.ns))
        return relayed(samples, rows) or _every_second(samples, rows, even)
    rows = _by_stamp(samples)
    found = _far_clocks(samples) or relayed(samples, rows)
    if found is not None:
        return found
    # Samples that are all there and in order are not copied.
    ordered = samples if len(rows) == len(samples.ns) and (np.diff(rows) == 1).all() else samples[rows]
    clock = find_clock(ordered.ns, ordered.omega, ordered.force)
    if clock is None:
        return None
    member = clock >= 0
    found = None if member.all() else _beside(samples, rows[member], rows[~member])
    slot = clock[member]
    return found or _every_second(samples, rows[member], lambda at: slot[at])


def _clock_set_back(ns: Ints) -> bool:
    """Whether stamps (n,), in the order of arrival, begin anew at an earlier time: that is looked for elsewhere."""
    newest, run, back, late = np.iinfo(np.int64).min, 0, 0, False
    for rows in pieces(len(ns)):
        before = np.maximum.accumulate(np.concatenate([[newest], ns[rows]]))
        sound = np.flatnonzero(ns[rows] >= before[:-1])
        runs = np.diff(np.concatenate([[-1 - run], sound, [rows.stop - rows.start]])) - 1
        late |= bool(runs.max() > _LATE)
        back += int(np.count_nonzero(np.diff(ns[rows.start : rows.stop + 1]) < 0))
        newest, run = int(before[-1]), int(runs[-1])
    return late and back <= _SWITCHES


def _plain_slots(ns: Ints) -> Callable[[Ints], Ints] | None:
    """Return what counts the intervals up to some samples, where stamps are even and only whole samples missing."""
    interval = nominal_interval_ns(ns)
    if interval <= 0:
        return None
    at, length, short = [], [], []
    for rows in pieces(len(ns) - 1, 1):
        step = np.diff(ns[rows])
        long = step > _MISSING * interval
        if not (np.abs(step - interval)[~long] <= _UNEVEN * interval).all():
            return None
        at.append(rows.start + 1 + np.flatnonzero(long))
        length.append(step[long])
        short.append(int(step[~long].sum()))
    first, gaps = np.concatenate(at), np.concatenate(length)
    if len(first) > _GAPS * len(ns):
        return None
    mean = sum(short) / (len(ns) - 1 - len(first))
    extra = np.concatenate([[0], np.cumsum(np.rint(gaps / mean).astype(np.int64) - 1)])
    return lambda rows: np.asarray(rows + extra[np.searchsorted(first, rows, side="right")])


def _by_stamp(samples: Samples) -> Ints:
    """Rows of the finite samples by their stamps."""
    if all_finite(samples.omega) and all_finite(samples.force):
        return np.argsort(samples.ns, kind="stable")
    finite = np.isfinite(samples.omega).all(axis=1) & np.isfinite(samples.force).all(axis=1)
    rows = np.flatnonzero(finite)
    return np.asarray(rows[np.argsort(samples.ns[rows], kind="stable")])


def _far_clocks(samples: Samples) -> Split | None:
    """Tell two publishers whose clocks are so far apart that their stamps do not overlap."""
    if np.count_nonzero(np.diff(samples.ns) < 0) <= _SWITCHES:
        return None
    ordered = np.sort(samples.ns)
    later = samples.ns > ordered[np.argmax(np.diff(ordered))]
    first, second = np.flatnonzero(~later), np.flatnonzero(later)
    if min(len(first), len(second)) < _FEW or not _alternate(first, second):
        return None
    return _chosen(samples, first, second)


def _every_second(samples: Samples, rows: Ints, slot: Callable[[Ints], Ints]) -> Split | None:
    """Tell two streams that make one even clock of twice the rate; `rows` by their stamps, `slot` of their places."""
    at = in_blocks(rows)
    values, places = samples.values(rows[at]), slot(at)
    finite = np.asarray(np.isfinite(values).all(axis=-1))
    values[~finite] = 0.0
    next_one = (np.diff(places, axis=1) == 1) & finite[:, 1:] & finite[:, :-1]
    beside = next_one[:, 1:] & next_one[:, :-1]
    sign = np.where(places[:, 1:-1] % 2 == 0, 1.0, -1.0)
    off = off_line(values) * sign[..., None]
    enough = 2 * beside.sum(axis=1) >= beside.shape[1]
    blocks = [block[good] for block, good in zip(off[enough], beside[enough], strict=True)]
    if not of_two_sensors(blocks, values[enough], np.zeros(6)):
        return None
    odd = slot(np.arange(len(rows))) % 2 != 0
    first, second = np.sort(rows[~odd]), np.sort(rows[odd])
    return _chosen(samples, first, second) if _alternate(first, second) else None


def _beside(samples: Samples, clock: Ints, left: Ints) -> Split | None:
    """Tell samples beside an even clock that are of another sensor; `clock` and `left` are rows by their stamps."""
    after = np.clip(np.searchsorted(samples.ns[clock], samples.ns[left]), 1, len(clock) - 1)
    twice = samples.ns[left] == samples.ns[clock[after]]
    twice &= (samples.values(left) == samples.values(clock[after])).all(axis=1)
    left, after = left[~twice], after[~twice]
    first, second = np.sort(clock), np.sort(left)
    if not len(left) or not _alternate(first, second):
        return None
    if len(left) < _FEW:
        return foreign_samples(samples, clock, left, after)
    at = in_blocks(left)
    off = off_clock(samples, clock, left[at], after[at])
    values = samples.values(clock[after[at]])
    motion = np.median(np.abs(np.median(off_line(values), axis=1)), axis=0)
    differ = of_two_sensors(list(off), values, motion)
    return _chosen(samples, first, second) if differ else None


def _alternate(first: Ints, second: Ints) -> bool:
    """Whether two streams, rows in the order of arrival, arrive in turn: a clock set back changes once."""
    changes = np.count_nonzero(np.diff(np.searchsorted(first, second)))
    return bool(changes + 1 > min(_SWITCHES, len(second) // 2))


def _chosen(samples: Samples, first: Ints, second: Ints) -> Split:
    """Keep that of two streams with other values which is of the test."""
    kept, out = (first, second) if len(first) >= len(second) else (second, first)
    why = "as they are fewer"
    clear = len(out) <= _CLEAR * len(kept)
    spans = [int(np.ptp(samples.ns[rows])) for rows in (kept, out)]
    # A short stream does not show whether its sensor would turn.
    if min(spans) > _CLEAR * max(spans):
        turns = [_turning(samples.force[rows]) for rows in (kept, out)]
        if turns[0] != turns[1]:
            kept, out = (kept, out) if turns[0] else (out, kept)
            clear, why = True, "as their sensor does not turn"
    both = f"{_counted(samples, kept)} and {_counted(samples, out)}"
    if not clear:
        raise DataError(
            f"{samples.where}: two publishers write to one topic, {both}, and nothing says which is the IMU of the "
            f"test; {ADVICE}, and record again"
        )
    note = f"{samples.topic}: two publishers with other values, {both}; the second are left out, {why}: {ADVICE}"
    return Split(out, note)


def _turning(force: Floats) -> bool:
    """Whether the specific force (n, 3) changes its direction as in turns."""
    medians = np.median(force[in_blocks(np.arange(len(force)))], axis=1)
    return bool(np.ptp(medians, axis=0).max() > _TURNS * np.linalg.norm(medians, axis=1).mean())


def _counted(samples: Samples, rows: Ints) -> str:
    """Write how many samples a stream has, and how often."""
    return f"{len(rows)} samples at {1e9 / max(float(np.median(np.diff(samples.ns[rows]))), 1.0):.4g} Hz"


_APART = 6.0
"""Ratio of the distance of a stray from its neighbours to the noise (1), at least: by chance it stays below."""
_SIDE = 5
"""Number of samples to each side that say how rough the motion is: as long as it takes a turn to begin."""
_ROUGH = 2.0
"""Ratio of the distance of a stray to the largest one of the samples about it (1), at least: noise is alike."""
_MOVED = 5.0
"""Number of intervals in which a turn may explain the distance: a clock set back gives samples stamps of others."""
_NEIGHBOURS = 1.3
"""Distance (intervals) of the samples before and behind a stray at most: none of them is missing, so it is one more."""


def foreign_samples(samples: Samples, clock: Ints, left: Ints, after: Ints) -> Split | None:
    """Tell single samples between two others of the clock, none missing, whose values do not belong there.

    Parameters
    ----------
    clock, left, after : ndarray of int
        As for `off_clock`; `left` has the shape (m,).

    Returns
    -------
    Split or None
        None where all belong there.
    """
    interval = usual_interval(samples.ns[clock])
    inside = samples.ns[clock[after]] - samples.ns[clock[after - 1]] < _NEIGHBOURS * interval
    left, after = left[inside], after[inside]
    if not len(left):
        return None
    off = np.abs(off_clock(samples, clock, left, after))
    around = np.clip(after[:, None] + np.arange(-_SIDE - 1, _SIDE + 1), 0, len(clock) - 1)
    beside = samples.values(clock[around])
    rough = np.abs(off_line(beside)).max(axis=1)
    change = np.abs(beside[:, -1] - beside[:, 0]) / (around.shape[1] - 1)
    noise = GAUSS_MAD * np.median(np.abs(off_line(samples.values(clock[in_blocks(clock)]))), axis=(0, 1))
    foreign = (off > np.maximum(_APART * noise, np.maximum(_ROUGH * rough, _MOVED * change))).any(axis=1)
    if not foreign.any():
        return None
    # Of the same sensor are those, too, whose values happen to fit: they are one more all the same.
    number = counted(len(left), "sample is", "samples are")
    first = (samples.ns[left[0]] - samples.ns[clock[0]]) * 1e-9
    note = (
        f"{samples.topic}: {number} of another sensor and left out (the first {first:.1f} s after the start): more "
        "than the even clock of the others has, with other values; look for a second publisher"
    )
    return Split(left, note)


_REPEATED = 0.05
"""Share of samples whose values were there before from which a relay is looked for: a short one does no harm."""
_SAME_DELAY = 0.9
"""Share of the repeated values that come at one delay from which they are those of a relay: a coarse sensor repeats
its values at any distance."""
_TWICE = 2
"""Number of times that a relay brings a reading: a coarse sensor repeats its own more often."""
_DELAY_SCATTER = 0.5
"""Scatter of that delay (intervals): the jitter of two computers."""


def relayed(samples: Samples, rows: Ints) -> Split | None:
    """Tell readings that come once more under another stamp: a relay publishes on the topic which it listens to.

    Noise does not repeat itself. A coarse sensor does, but at any distance and more than twice; messages that are sent
    twice have one stamp.

    Parameters
    ----------
    rows : ndarray of int, shape (n,)
        Rows of finite samples by their stamps.

    Returns
    -------
    Split or None
        The later ones; None where readings do not repeat, or as those of a coarse sensor do.
    """
    some = np.sort(_marks(samples.values(rows[in_blocks(rows)])), axis=1)
    if np.mean(some[:, 1:] == some[:, :-1]) < _REPEATED:
        return None
    marks = _marks(samples.values(rows))
    order = np.argsort(marks, kind="stable")
    first = np.flatnonzero(np.diff(marks[order], prepend=~marks[order[0]]))
    times = np.diff(first, append=len(order))
    again = first[times == _TWICE] + 1
    delay = samples.ns[rows[order[again]]] - samples.ns[rows[order[again - 1]]]
    again, delay = again[delay > 0], delay[delay > 0]
    if _TWICE * len(again) < max(_REPEATED * len(rows), _SAME_DELAY * times[times > 1].sum()):
        return None
    usual = float(np.median(delay))
    near = np.abs(delay - usual) <= _DELAY_SCATTER * usual_interval(samples.ns[rows])
    if near.mean() < _SAME_DELAY:
        return None
    out = rows[order[again]]
    note = (
        f"{samples.topic}: {len(out)} of {len(rows)} samples are others once more, {usual * 1e-6:.3g} ms later, and "
        f"left out (a relay publishes on the same topic, or the driver sends each reading twice); {ADVICE}"
    )
    return Split(out, note)


def _marks(values: Floats) -> Ints:
    """One number for each row (..., 6) that equal rows share."""
    bits = np.ascontiguousarray(values + 0.0).view(np.uint64)
    return np.asarray((bits * (2 * np.arange(6, dtype=np.uint64) + np.uint64(0x9E3779B97F4A7C15))).sum(axis=-1))
