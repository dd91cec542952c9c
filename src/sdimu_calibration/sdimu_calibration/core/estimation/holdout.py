"""Segments of a recording that are kept from a fit, so that it can be tried on what it has not seen.

Only segments at the start and at the end can be left out: the first position after a segment in between would tell
the fit what the samples in it add up to.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from sdimu_calibration.core.alignment.prepared import PreparedData
from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.data.epochs import Epochs
from sdimu_calibration.core.data.gaps import Bridges
from sdimu_calibration.core.data.phases import Phases
from sdimu_calibration.core.recording import DataError

WANTED_S = 600.0
"""Length of the navigation that is wanted (s): errors of coefficients grow to metres in it."""
LEAST_S = 60.0
"""Least length of the navigation (s): a shorter one says nothing."""
LEVEL_S = 100.0
"""Longest part of the dwell before it that levels (s): biases are constant over it."""
_LEAST_LEVEL_S = 10.0
"""Shortest rest that levels (s): a shorter one leaves the noise of the accelerometers in the tilt."""
_KEPT = 0.5
"""Share of the recording that the fit keeps at least: from less, its coefficients say little of those of the whole."""


@dataclass(frozen=True)
class Segment:
    """A part of a recording that the fit does not see, as indices of epochs."""

    place: str
    """``end`` or ``start``."""
    first: int
    """First epoch of the dwell that levels."""
    start: int
    last: int
    """`start`, `last`: first epoch that is navigated, and one after the last."""
    seen: tuple[int, int]
    """First epoch of the fit, and one after its last."""
    begin_s: float
    levelled_s: float
    length_s: float
    """`begin_s`, `levelled_s`, `length_s`: begin of navigation, length of levelling and of navigation."""

    @property
    def end_s(self) -> float:
        """End of navigation (s)."""
        return self.begin_s + self.length_s


def holdout_segments(prepared: PreparedData) -> tuple[Segment, ...]:
    """Choose what to keep from the fit: `WANTED_S` of navigation after a dwell, at the end and at the start.

    Of a recording too short for that, the longest segments that leave half of it to the fit.
    """
    ready, level = _ready(prepared)
    found = [s for s in (_at_end(prepared, ready, level), _at_start(prepared, ready, level)) if s]
    if not found:
        raise DataError(
            f"the recording is too short to keep {LEAST_S:.0f} s after a dwell from the fit and leave half of it"
        )
    return tuple(found)


def unseen_segment(prepared: PreparedData) -> Segment:
    """Choose what to navigate of a recording that no fit has seen: `WANTED_S` after its first dwell, or what there is.

    Raises
    ------
    DataError
        Where less than `LEAST_S` is left after a dwell.
    """
    ready, level = _ready(prepared)
    if ready.any():
        at = int(np.argmax(ready))
        segment = _segment("start", prepared, level, at, (0, at + 1))
        if segment is not None:
            return segment
    raise DataError(f"the recording is too short to navigate {LEAST_S:.0f} s after a dwell")


def _ready(prepared: PreparedData) -> tuple[Bools, Floats]:
    """After which epochs a navigation may begin, and how long the dwell before it levels (s); both shape (e,)."""
    used, epochs = prepared.phases.used, prepared.epochs
    index = np.arange(len(used))
    begun = np.maximum.accumulate(np.where(used, -1, index)) + 1
    rested = np.where(used, epochs.end - epochs.start[np.minimum(begun, len(used) - 1)], 0.0)
    # Where a dwell ends, or has lasted long enough.
    ready = (rested >= _LEAST_LEVEL_S) & (np.append(~used[1:], True) | (rested >= LEVEL_S - 1e-6))
    return ready, np.minimum(rested, LEVEL_S)


def _at_end(prepared: PreparedData, ready: Bools, level: Floats) -> Segment | None:
    """Segment at the end; `ready` (e,) says after which epochs one may begin, `level` (e,) how long it levels (s)."""
    end = prepared.epochs.end
    fits = ready & (end - level >= _KEPT * end[-1])
    late = np.flatnonzero(fits & (end <= end[-1] - WANTED_S + 1e-6))
    if not fits.any():
        return None
    at = int(late[-1] if len(late) else np.flatnonzero(fits)[0])
    return _segment("end", prepared, level, at, (0, _level_from(prepared, level, at)))


def _at_start(prepared: PreparedData, ready: Bools, level: Floats) -> Segment | None:
    """Segment at the start, with the arguments of `_at_end`."""
    epochs, used = prepared.epochs, prepared.phases.used
    if not ready.any():
        return None
    at = int(np.argmax(ready))
    # The fit starts in a dwell: there it finds its attitude.
    resumes = np.flatnonzero(used & (epochs.start <= (1.0 - _KEPT) * epochs.end[-1]))
    resumes = resumes[resumes > at]
    if not len(resumes):
        return None
    after = np.flatnonzero(epochs.start[resumes] >= epochs.end[at] + WANTED_S - 1e-6)
    resume = int(resumes[after[0]] if len(after) else resumes[-1])
    return _segment("start", prepared, level, at, (resume, len(epochs)))


def _level_from(prepared: PreparedData, level: Floats, at: int) -> int:
    """First epoch that levels, of a navigation that begins after the epoch `at`."""
    return int(np.searchsorted(prepared.epochs.start, prepared.epochs.end[at] - level[at] - 1e-6))


def _segment(place: str, prepared: PreparedData, level: Floats, at: int, seen: tuple[int, int]) -> Segment | None:
    """Segment of `WANTED_S` or what there is beside the epochs of the fit, navigated after the epoch `at`."""
    epochs, first = prepared.epochs, _level_from(prepared, level, at)
    last = int(np.searchsorted(epochs.end, epochs.end[at] + WANTED_S + 1e-6, side="right"))
    if seen[0] > at:
        last = min(last, seen[0])
    begin = float(epochs.end[at])
    length = float(epochs.end[last - 1]) - begin
    if length < LEAST_S:
        return None
    return Segment(place, first, at + 1, last, seen, begin, begin - float(epochs.start[first]), length)


def part(prepared: PreparedData, first: int, last: int) -> PreparedData:
    """Cut out epochs ``first:last`` with their cycles."""
    epochs, rows = prepared.epochs, slice(first, last)
    begin, end = int(epochs.first[first]), int(epochs.last[last - 1])
    cut = {field.name: getattr(epochs, field.name)[rows] for field in fields(Epochs)}
    cut |= {name: cut[name] - begin for name in ("first", "last")}
    phases = Phases(*(getattr(prepared.phases, field.name)[rows] for field in fields(Phases)))
    bridges = Bridges(*(getattr(prepared.bridges, field.name)[rows] for field in fields(Bridges)))
    return replace(
        prepared,
        cycles=prepared.cycles[begin:end],
        epochs=Epochs(**cut),
        phases=phases,
        kind=prepared.kind[rows],
        bridges=bridges,
        seconds=None,
    )
