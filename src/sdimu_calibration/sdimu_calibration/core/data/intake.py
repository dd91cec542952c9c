"""What a running test brings, handed to the filter on the way second by second; what it has used is forgotten."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.data.far_samples import far_samples, largest
from sdimu_calibration.core.data.recent_log import RecentLog
from sdimu_calibration.core.data.stray_stamps import NEVER
from sdimu_calibration.core.recording import (
    NOMINAL_FROM,
    PhaseLog,
    TemperatureLog,
    nominal_interval_ns,
    origin_ns,
    seconds,
)

_WAITING = 100 * NOMINAL_FROM
"""Number of samples that wait for the origin at most: of more, those whose stamps ascend are enough."""
_REPEATED = 16_384
"""Number of the latest statuses that are kept even where they repeat the one before: one that comes late finds its
place among them. 82 s at 200 Hz."""


class Intake:
    """Samples, status and temperatures of a running test, by stamps in ns.

    Attributes
    ----------
    origin_ns : int or None
        Stamp from which times count; None until `NOMINAL_FROM` intervals have come.
    interval_s : float
        Nominal sample interval (s).
    taken, late, rejected : int
        Samples handed to the filter; not later than the newest one; not handed over at all.
    has_status : bool
        Whether the table has said anything.
    """

    def __init__(self) -> None:
        self.origin_ns: int | None = None
        self.interval_s = 0.0
        self.taken = self.late = self.rejected = 0
        self.has_status = False
        self._queue: list[tuple[Ints, Floats, Floats]] = []
        self._newest_ns = NEVER
        self._largest = (0.0, 0.0)
        self._status, self._status_full = RecentLog(2), 2 * _REPEATED
        self._temperature = RecentLog(1)

    def add_samples(self, ns: Ints, omega: Floats, force: Floats) -> None:
        """Take samples.

        Parameters
        ----------
        ns : ndarray of int, shape (n,)
            Header stamps (ns).
        omega, force : ndarray, shape (n, 3)
            In the units of the messages.
        """
        if len(ns):
            block = (np.array(ns, dtype=np.int64), np.array(omega, dtype=float), np.array(force, dtype=float))
            self._queue.append(block)
        if self.origin_ns is None:
            self._learn_origin()

    def _learn_origin(self) -> None:
        if sum(len(ns) for ns, _, _ in self._queue) <= NOMINAL_FROM:
            return
        ns, omega, force = (np.concatenate(part) for part in zip(*self._queue, strict=True))
        finite = _finite(omega, force)
        usable = finite & _later(ns, finite, NEVER)
        if usable.sum() > NOMINAL_FROM:
            self.origin_ns = origin_ns(ns[usable])
            self.interval_s = nominal_interval_ns(ns[usable]) * 1e-9
        elif len(ns) > _WAITING:
            self._count(finite, usable)
            self._queue = [(ns[usable], omega[usable], force[usable])] if usable.any() else []

    def add_status(self, ns: int, dwell: bool, stop: int) -> None:
        """Take a status that holds from a stamp on (stop `UNNUMBERED` where it names none)."""
        self.has_status = True
        self._status.add(ns, dwell, stop)
        # The filter forgets what it has used; while no samples come it uses nothing.
        if len(self._status.ns) > self._status_full:
            self._keep_status(len(self._status.ns) - _REPEATED)
            self._status_full = max(2 * _REPEATED, 2 * len(self._status.ns))

    def _keep_status(self, first: int) -> None:
        """Forget the statuses before a row that repeat the one before them."""
        status = self._status
        changes = np.concatenate([[True], (status.values[1:] != status.values[:-1]).any(axis=1)])
        status.keep(changes | (np.arange(len(changes)) >= first))

    def add_temperature(self, ns: int, value: float) -> None:
        """Take a temperature (deg C)."""
        if np.isfinite(value):
            self._temperature.add(ns, value)

    @property
    def first_ns(self) -> int | None:
        """Stamp (ns) of the earliest sample that waits."""
        return min((int(block[0].min()) for block in self._queue), default=None)

    def clear(self) -> None:
        """Forget everything: nobody takes it."""
        self._queue, self._status, self._temperature = [], RecentLog(2), RecentLog(1)

    def due(self, until_ns: int) -> tuple[Ints, Floats, Floats]:
        """Hand over the samples up to a stamp: finite, not far beyond all others, each later than the one before.

        The others are counted.

        Returns
        -------
        ns : ndarray of int, shape (n,)
        omega, force : ndarray, shape (n, 3)
            In the units of the messages.
        """
        parts, later = [], []
        for block in self._queue:
            now = block[0] <= until_ns
            if now.any():
                parts.append(tuple(column[now] for column in block))
            if not now.all():
                later.append((block[0][~now], block[1][~now], block[2][~now]))
        self._queue = later
        if not parts:
            return np.empty(0, dtype=np.int64), np.empty((0, 3)), np.empty((0, 3))
        ns, omega, force = (np.concatenate(part) for part in zip(*parts, strict=True))
        sound = _finite(omega, force) & ~self._far(omega, force)
        keep = sound & _later(ns, sound, self._newest_ns)
        self.taken += int(keep.sum())
        self._count(sound, keep)
        if keep.any():
            self._newest_ns = int(ns[keep][-1])
            self._largest = max(self._largest[0], largest(omega[keep])), max(self._largest[1], largest(force[keep]))
        return ns[keep], omega[keep], force[keep]

    def _far(self, omega: Floats, force: Floats) -> Bools:
        """Find samples far beyond all that have come; the end of the test knows all others, too."""
        far = far_samples(self.interval_s, omega, force, self._largest)
        return np.asarray(far[0] | far[1])

    def _count(self, sound: Bools, keep: Bools) -> None:
        """Count samples that are not kept."""
        self.rejected += int(np.sum(~keep))
        self.late += int(np.sum(sound & ~keep))

    def phase_log(self) -> PhaseLog | None:
        """Phases so far, by their stamps; of those that were forgotten, the changes."""
        if not len(self._status.ns) or self.origin_ns is None:
            return None
        dwell, stop = self._status.values.T
        return PhaseLog(seconds(self._status.ns, self.origin_ns), dwell != 0.0, stop.astype(np.int64))

    def temperature_log(self) -> TemperatureLog | None:
        """Temperatures by their stamps: the first one, and those that were not forgotten."""
        if not len(self._temperature.ns) or self.origin_ns is None:
            return None
        return TemperatureLog(seconds(self._temperature.ns, self.origin_ns), self._temperature.values[:, 0].copy())

    def forget(self, before_s: float) -> None:
        """Forget what nobody asks for once the filter is beyond a time (s).

        Of the status the changes stay, which tell whether its stops have numbers; of the temperature the first value,
        from which all others count. What holds at `before_s` stays.
        """
        assert self.origin_ns is not None
        before_ns = self.origin_ns + round(before_s * 1e9)
        temperature = self._temperature
        if len(self._status.ns):
            self._keep_status(_holding(self._status.ns, before_ns))
        if len(temperature.ns):
            row = np.arange(len(temperature.ns))
            temperature.keep((row == 0) | (row >= _holding(temperature.ns, before_ns)))


def _holding(ns: Ints, at_ns: int) -> int:
    """Row that holds at a stamp (ns); -1 before the first."""
    return int(np.searchsorted(ns, at_ns, side="right")) - 1


def _finite(omega: Floats, force: Floats) -> Bools:
    return np.asarray(np.isfinite(omega).all(axis=1) & np.isfinite(force).all(axis=1))


def _later(ns: Ints, finite: Bools, newest_ns: int) -> Bools:
    """Find samples whose stamp is beyond that of every finite sample before them."""
    newest = np.maximum.accumulate(np.concatenate([[newest_ns], np.where(finite, ns, newest_ns)]))
    return np.asarray(ns > newest[:-1])
