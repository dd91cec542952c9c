"""Steps of the clock that writes the stamps: a computer that is set right in the middle of a test.

Samples come evenly, so that their count is a clock. Missing samples set the stamps on by whole intervals; a step of the
clock sets them on by any time, or back. What it stands for is not certain: a driver that paused leaves the same stamps.
Samples are taken as even across the step, and the angle turned in its length is uncertain, as in a gap. A step on by
whole intervals is what missing samples leave, and taken as such unless gravity tells it (`whole_steps`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.data.blocks import pieces
from sdimu_calibration.core.probability import GAUSS_MAD
from sdimu_calibration.core.recording import NOMINAL_FROM, ClockStep, nominal_interval_ns

_LEAST = 0.05
"""Length of a step (intervals) at least: a shorter one turns a table by less than its noise."""
_CLEAR = 6.0
"""Ratio of a step to the scatter of the stamps from which it is none of their jitter: chance ends below."""
_SIDE = 100
"""Number of samples on each side of a step that say where the stamps are: jitter is averaged, the drift of a clock is
not yet seen."""
_FEWEST = 10
"""Number of samples on each side of a step at least: fewer say nothing of jitter."""
_LONGEST_S = 0.5
"""Length of a step (s) at most: what is longer is a pause of the driver, and a gap."""
_BACK = 4.0
"""Length of a step back (intervals) at most: a longer one covers times that other samples have, and is refused."""
_MANY = 300
"""Number of uneven places from which stamps are uneven by nature: each would be looked at."""


_ENOUGH = 100_000
"""Number of distances of which a median is taken at most: more decide nothing that these do not."""


class Step(NamedTuple):
    """A step: the first sample after it, and its length (ns), below zero where the clock was set back."""

    row: int
    ns: int


def find_steps(ns: Ints, omega: Floats, force: Floats) -> tuple[Step, ...]:
    """Find steps of the clock.

    Parameters
    ----------
    ns : ndarray of int, shape (n,)
        Stamps (ns) in the order of arrival.
    omega, force : ndarray, shape (n, 3)
        As recorded: a sample that was sent twice is no step.
    """
    if len(ns) <= max(NOMINAL_FROM, 2 * _FEWEST) or nominal_interval_ns(ns) <= 0:
        return ()
    interval = usual_interval(ns)
    places = _uneven(ns, interval)
    if not len(places):
        return ()
    scatter = GAUSS_MAD * float(np.median(np.abs(np.diff(ns) - interval)))
    places = places[np.abs(ns[places] - ns[places - 1] - interval) > _CLEAR * scatter]
    if not len(places) or len(places) > _MANY:
        return ()
    # Places beside each other are one event: a sample that is late is out of its place twice.
    groups = np.split(places, np.flatnonzero(np.diff(places) > _FEWEST) + 1)
    edges = [0, *(int(group[-1]) for group in groups), len(ns)]
    steps = []
    for k, group in enumerate(groups):
        first, last = int(group[0]), int(group[-1])
        end = int(groups[k + 1][0]) if k + 1 < len(groups) else len(ns)
        length = _length(ns, (max(edges[k], first - _SIDE), first), (last, min(end, last + _SIDE)), interval, scatter)
        if length and not (length < 0 and _repeats(ns, omega, force, first, last)):
            steps.append(Step(last, length))
    return tuple(steps)


def undone(ns: Ints, samples_ns: Ints, steps: tuple[Step, ...]) -> Ints:
    """Take the steps out of stamps.

    Parameters
    ----------
    ns : ndarray of int, shape (m,)
        Stamps of any topic (ns), as they came.
    samples_ns : ndarray of int, shape (n,)
        Those of the samples (ns), of which the rows of the steps count; for them the rows decide, not the stamps.

    Returns
    -------
    ndarray of int, shape (m,)
    """
    out = ns.copy()
    for step in steps:
        later = np.arange(len(ns)) >= step.row if ns is samples_ns else ns >= samples_ns[step.row]
        out[later] -= step.ns
    return out


def as_recorded(steps: tuple[Step, ...], mended_ns: Ints, start_ns: int) -> tuple[ClockStep, ...]:
    """Place steps on the time of a recording.

    Parameters
    ----------
    mended_ns : ndarray of int, shape (n,)
        Stamps of the samples without them (ns), in the order of arrival.
    start_ns : int
        Start of the recording (ns).
    """
    return tuple(ClockStep((int(mended_ns[step.row]) - start_ns) * 1e-9, step.ns * 1e-9) for step in steps)


def usual_interval(ns: Ints) -> float:
    """Interval (ns): the median over many samples at a time, in which jitter hardly counts.

    Parameters
    ----------
    ns : ndarray of int, shape (n,)
        Stamps (ns) in the order of arrival; at least two.
    """
    lag = min(_SIDE, len(ns) // 2)
    first = np.arange(0, len(ns) - lag, max(len(ns) // _ENOUGH, 1))
    return float(np.median(ns[first + lag] - ns[first])) / lag


def _uneven(ns: Ints, interval: float) -> Ints:
    """Rows of samples that come at another distance from the one before."""
    return np.concatenate(
        [
            rows.start + 1 + np.flatnonzero(np.abs(np.diff(ns[rows]) - interval) > _LEAST * interval)
            for rows in pieces(len(ns) - 1, 1)
        ]
    )


def _length(ns: Ints, before: tuple[int, int], after: tuple[int, int], interval: float, scatter: float) -> int:
    """Length of the step (ns) between two stretches of samples, given as rows from and to; 0 for none."""
    if min(before[1] - before[0], after[1] - after[0]) < _FEWEST:
        return 0
    late = []
    for first, last in (before, after):
        rows = np.arange(first, last)
        late.append(float(np.median((ns[rows] - ns[before[0]]) - interval * (rows - before[0]))))
    step = late[1] - late[0]
    # Missing samples are whole intervals, and never less than none.
    missing = max(round(step / interval), 0)
    apart = abs(step - missing * interval)
    clear = max(_LEAST * interval, _CLEAR * scatter / np.sqrt(_FEWEST))
    longest = _LONGEST_S * 1e9 if step > 0.0 else _BACK * interval
    return round(step) if apart > clear and abs(step) <= longest else 0


def _repeats(ns: Ints, omega: Floats, force: Floats, first: int, last: int) -> bool:
    """Whether samples after a step back are some before it, sent once more."""
    before = slice(max(first - _FEWEST, 0), first)
    for row in range(first, min(last + 1, len(ns))):
        same = (ns[before] == ns[row]) & (omega[before] == omega[row]).all(axis=1)
        if (same & (force[before] == force[row]).all(axis=1)).any():
            return True
    return False
