"""Samples whose stamp is of no time of the test: a glitch of the driver, zero or years ahead, in a sample or a few.

The order of arrival tells them: what came before and after agree in time with each other, and not with them. One sample
years ahead would be the end of a recording that has only missing samples between. A clock that is set stays as it is
set, and two publishers with different clocks send many samples each: neither is a stray.
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.data.blocks import pieces
from sdimu_calibration.core.plain_text import counted

NEVER = -(2**62)
"""Stamp before all others (ns): where nothing has come yet."""
_FAR_NS = 600_000_000_000
"""Distance from the samples before and after (ns) from which a stamp is of another time: no message is late by ten
minutes, and a glitch of the driver is by an hour or by years."""
_IN_A_ROW = 3
"""Number of stray samples in a row at most: more are a clock that was set."""
_SHARE = 0.01
"""Share of stray samples (1) at most: more are a second publisher."""
_FEW = 5
"""Number of stray samples that may be in any recording: the share of a short one is less than one sample."""
_HELD = 1000
"""Number of samples at most that wait for their neighbours: two publishers take turns for ever."""

Block = tuple[Ints, Floats, Floats]
"""Stamps (ns), shape (n,); rates and forces, shape (n, 3)."""


def stray_stamps(ns: Ints) -> Ints:
    """Rows of the samples whose stamps are of no time of the test, shape (m,).

    Parameters
    ----------
    ns : ndarray of int, shape (n,)
        Stamps (ns) in the order of arrival.
    """
    none = np.empty(0, dtype=np.int64)
    jumps = _jumps(ns)
    if not len(jumps):
        return none
    edges = np.concatenate([[0], jumps, [len(ns)]])
    short = np.diff(edges) <= _IN_A_ROW
    many = int(np.diff(edges)[short].sum()) > max(_FEW, _SHARE * len(ns))
    if many or short.all():
        return none
    strays = [none]
    sound = np.flatnonzero(~short)
    for k in np.flatnonzero(short).tolist():
        rows = np.arange(edges[k], edges[k + 1])
        before, after = edges[sound[sound < k][-1:] + 1] - 1, edges[sound[sound > k][:1]]
        ends = ns[np.concatenate([before, after])].tolist()
        # Behind a gap the test goes on later; a clock that was set back leaves nothing to compare with.
        if ends[-1] >= ends[0] - _FAR_NS:
            strays.append(rows[(ns[rows] < ends[0] - _FAR_NS) | (ns[rows] > ends[-1] + _FAR_NS)])
    return np.concatenate(strays)


def stray_note(strays_ns: Ints) -> str:
    """Say which samples are left out.

    Parameters
    ----------
    strays_ns : ndarray of int, shape (m,)
        Their stamps (ns), at least one.
    """
    what = counted(len(strays_ns), "sample has a stamp", "samples have stamps")
    which = "" if len(strays_ns) == 1 else "the first "
    return (
        f"{what} outside the test ({which}{stamp_text(int(strays_ns[0]))}), left out; check header.stamp of the driver"
    )


def _jumps(ns: Ints) -> Ints:
    """Rows of samples whose stamps (n,) are far from that of the sample before, shape (m,)."""
    found = [rows.start + 1 + np.flatnonzero(_far(np.diff(ns[rows]))) for rows in pieces(max(len(ns) - 1, 0), 1)]
    return np.concatenate(found) if found else np.empty(0, dtype=np.int64)


def _far(distance_ns: Ints) -> Bools:
    return np.asarray(np.abs(distance_ns) > _FAR_NS)


FAR_NS = 86_400_000_000_000
"""Distance from the samples (ns) from which a message is of another time: a day, longer than a table stands still."""


def strays(ns: Ints, samples_ns: Ints) -> Bools:
    """Find messages of a side topic far from all samples, or from each other where most are far from the samples.

    A message years away would stretch everything that is laid out by time from the first status to the last: 1970 to
    today is 64 GB. A topic whose own clock is another one is no stray: it is kept whole, and `status_clock` compares it
    with the motion.

    Parameters
    ----------
    ns : ndarray of int, shape (m,)
        Stamps of the messages (ns), ascending.
    samples_ns : ndarray of int, shape (n,)
        Stamps of the samples (ns), ascending; at least two.

    Returns
    -------
    ndarray of bool, shape (m,)
    """
    far = _distance(ns, samples_ns) > FAR_NS
    if 2 * np.count_nonzero(far) <= len(ns):
        return far
    # Another clock: a day more than the test lasts, about the middle of its messages.
    length = len(samples_ns) * float(np.median(np.diff(samples_ns)))
    return np.asarray(np.abs((ns - ns[len(ns) // 2]).astype(np.float64)) > FAR_NS + length)


def strays_note(topic: str, strays_ns: Ints) -> str:
    """Say which messages of a side topic are left out.

    Parameters
    ----------
    topic : str
        Name of the topic.
    strays_ns : ndarray of int, shape (m,)
        Their stamps (ns), at least one.
    """
    what = counted(len(strays_ns), "message has a stamp", "messages have stamps")
    return f"{topic}: {what} outside the test (the first {stamp_text(int(strays_ns[0]))}): ignored"


def _distance(ns: Ints, samples_ns: Ints) -> Ints:
    """Distance of each stamp from the nearest sample (ns), shape (m,)."""
    after = np.minimum(np.searchsorted(samples_ns, ns), len(samples_ns) - 1)
    before = np.maximum(after - 1, 0)
    return np.asarray(np.minimum(np.abs(samples_ns[after] - ns), np.abs(ns - samples_ns[before])))


def stamp_text(ns: int) -> str:
    """Stamp (ns) as date and time, UTC."""
    return f"{np.datetime64(ns, 'ns').astype('datetime64[s]')}Z"


class StampSieve:
    """Leaves stray samples out of a test that goes on: what is far in time waits until its neighbours have come.

    Attributes
    ----------
    first_ns, newest_ns : int
        First and newest stamp (ns) of the samples that were let through; `NEVER` before the first.
    """

    def __init__(self) -> None:
        self.first_ns = self.newest_ns = NEVER
        self._last_ns: int | None = None
        self._held: list[Block] = []
        self._strays: list[int] = []

    def take(self, ns: Ints, omega: Floats, force: Floats) -> Block:
        """Take samples in the order of arrival, and give those back whose time is that of the test.

        Parameters
        ----------
        ns : ndarray of int, shape (n,)
            Stamps (ns).
        omega, force : ndarray, shape (n, 3)
            In any units.
        """
        last = self._last_ns
        if self._held or last is None or _far(np.diff(ns, prepend=last)).any():
            ns, omega, force = (np.concatenate(part) for part in zip(*self._held, (ns, omega, force), strict=True))
            passed, waiting = self._decided(ns.tolist())
            self._held = [(ns[waiting], omega[waiting], force[waiting])] if waiting else []
            ns, omega, force = ns[passed], omega[passed], force[passed]
        if len(ns):
            self._last_ns = int(ns[-1])
            self.first_ns = int(ns[0]) if self.first_ns == NEVER else self.first_ns
            self.newest_ns = max(self.newest_ns, int(ns.max()))
        return ns, omega, force

    def strays(self) -> Ints:
        """Stamps (ns) of the samples left out since the last call, shape (m,)."""
        found, self._strays = np.array(self._strays, dtype=np.int64), []
        return found

    def _decided(self, ns: list[int]) -> tuple[list[int], list[int]]:
        """Rows of samples that are let through, and of those that wait; the others are strays."""
        passed: list[int] = []
        waiting: list[int] = []
        last, run = self._last_ns, 0
        for row, stamp in enumerate(ns):
            if last is not None and abs(stamp - last) <= _FAR_NS:
                self._strays += [ns[one] for one in waiting]
                waiting = []
            else:
                run = run + 1 if waiting and abs(stamp - ns[waiting[-1]]) <= _FAR_NS else 1
                waiting.append(row)
                if run <= _IN_A_ROW and len(waiting) <= _HELD:
                    continue
                # A clock that was set, or the beginning; what waited before it is of neither time.
                before = 0 if len(waiting) > _HELD else len(waiting) - run
                self._strays += [ns[one] for one in waiting[:before]]
                passed += waiting[before:-1]
                waiting = []
            passed.append(row)
            last = stamp
        return passed, waiting
