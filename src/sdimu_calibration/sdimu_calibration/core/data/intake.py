"""What a running test has brought: in the order of arrival for its end, by the second for the filter on the way."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.data.arrival import RawStatus, RawTemperature, RawTest
from sdimu_calibration.core.recording import (
    NOMINAL_FROM,
    DataError,
    PhaseLog,
    TemperatureLog,
    nominal_interval_ns,
    origin_ns,
    seconds,
)

NEVER = -(2**62)
"""Stamp before all others (ns): where nothing has come yet."""


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
    """

    def __init__(self) -> None:
        self.origin_ns: int | None = None
        self.interval_s = 0.0
        self.taken = self.late = self.rejected = 0
        self._arrived: list[tuple[Ints, Floats, Floats]] = []
        self._queue: list[tuple[Ints, Floats, Floats]] = []
        self._newest_ns = NEVER
        self._status: list[tuple[int, bool, int]] = []
        self._temperature: list[tuple[int, float]] = []
        self._phase_log: PhaseLog | None = None
        self._temperature_log: TemperatureLog | None = None

    def add_samples(self, ns: Ints, omega: Floats, force: Floats) -> None:
        """Take samples.

        Parameters
        ----------
        ns : ndarray of int, shape (n,)
            Header stamps (ns).
        omega, force : ndarray, shape (n, 3)
            In the units of the messages.
        """
        block = (np.array(ns, dtype=np.int64), np.array(omega, dtype=float), np.array(force, dtype=float))
        self._arrived.append(block)
        self._queue.append(block)
        if self.origin_ns is None:
            self._learn_origin()

    def _learn_origin(self) -> None:
        if sum(len(ns) for ns, _, _ in self._queue) <= NOMINAL_FROM:
            return
        ns, omega, force = (np.concatenate(part) for part in zip(*self._queue, strict=True))
        usable = ns[_finite(omega, force) & _later(ns, _finite(omega, force), NEVER)]
        if len(usable) > NOMINAL_FROM:
            self.origin_ns = origin_ns(usable)
            self.interval_s = nominal_interval_ns(usable) * 1e-9

    def add_status(self, ns: int, dwell: bool, stop: int) -> None:
        """Take a status that holds from a stamp on (stop `UNNUMBERED` where it names none)."""
        self._status.append((ns, dwell, stop))
        self._phase_log = None

    def add_temperature(self, ns: int, value: float) -> None:
        """Take a temperature (deg C)."""
        self._temperature.append((ns, value))
        self._temperature_log = None

    def due(self, until_ns: int) -> tuple[Ints, Floats, Floats]:
        """Hand over the samples up to a stamp: finite, each later than the one before; the others are counted.

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
        finite = _finite(omega, force)
        new = _later(ns, finite, self._newest_ns)
        keep = finite & new
        self.taken += int(keep.sum())
        self.rejected += int(np.sum(~keep))
        self.late += int(np.sum(finite & ~new))
        if keep.any():
            self._newest_ns = int(ns[keep][-1])
        return ns[keep], omega[keep], force[keep]

    @property
    def has_status(self) -> bool:
        """Whether the table has said anything."""
        return bool(self._status)

    def phase_log(self) -> PhaseLog | None:
        """Phases so far, by their stamps."""
        if not self._status or self.origin_ns is None:
            return None
        if self._phase_log is None:
            ns, dwell, stop = zip(*sorted(self._status, key=lambda entry: entry[0]), strict=True)
            self._phase_log = PhaseLog(
                seconds(np.array(ns, np.int64), self.origin_ns), np.array(dwell), np.array(stop, np.int64)
            )
        return self._phase_log

    def temperature_log(self) -> TemperatureLog | None:
        """Temperatures so far, by their stamps."""
        if self._temperature_log is None and self.origin_ns is not None:
            entries = dict(sorted((ns, value) for ns, value in self._temperature if np.isfinite(value)))
            if entries:
                t = seconds(np.array(list(entries), np.int64), self.origin_ns)
                self._temperature_log = TemperatureLog(t, np.array(list(entries.values())))
        return self._temperature_log

    def raw(self) -> RawTest:
        """Everything that has come, as it came: what the front door takes at the end of the test.

        Raises
        ------
        DataError
            When there is too little of it.
        """
        if sum(len(ns) for ns, _, _ in self._arrived) <= NOMINAL_FROM:
            raise DataError("/imu/data_raw: too few samples have come to calibrate")
        ns, omega, force = (np.concatenate(part) for part in zip(*self._arrived, strict=True))
        status = temperature = None
        if self._status:
            at, dwell, stop = zip(*self._status, strict=True)
            status = RawStatus(np.array(at, np.int64), np.array(dwell), np.array(stop, np.int64))
        if self._temperature:
            at, value = zip(*self._temperature, strict=True)
            temperature = RawTemperature(np.array(at, np.int64), np.array(value))
        return RawTest(ns, omega, force, status, temperature)


def _finite(omega: Floats, force: Floats) -> Bools:
    return np.asarray(np.isfinite(omega).all(axis=1) & np.isfinite(force).all(axis=1))


def _later(ns: Ints, finite: Bools, newest_ns: int) -> Bools:
    """Find samples whose stamp is beyond that of every finite sample before them."""
    newest = np.maximum.accumulate(np.concatenate([[newest_ns], np.where(finite, ns, newest_ns)]))
    return np.asarray(ns > newest[:-1])
