"""Everything that a running test has brought, as it came, for its end."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.data.arrival import RawStatus, RawTemperature, RawTest


class KeptTest:
    """Keeps a test in memory; a journal (`storage.files.journal`) keeps it on a disk."""

    def __init__(self) -> None:
        self._samples = [(np.empty(0, dtype=np.int64), np.empty((0, 3)), np.empty((0, 3)))]
        self._status: list[tuple[int, bool, int]] = []
        self._temperature: list[tuple[int, float]] = []

    def samples(self, ns: Ints, omega_ib_b: Floats, f_ib_b: Floats) -> None:
        """Keep samples.

        Parameters
        ----------
        ns : ndarray of int, shape (n,)
            Header stamps (ns).
        omega_ib_b, f_ib_b : ndarray, shape (n, 3)
            In the units of the messages.
        """
        block = (np.array(ns, dtype=np.int64), np.array(omega_ib_b, dtype=float), np.array(f_ib_b, dtype=float))
        self._samples.append(block)

    def status(self, ns: int, dwell: bool, stop: int) -> None:
        """Keep a status."""
        self._status.append((ns, dwell, stop))

    def temperature(self, ns: int, value: float) -> None:
        """Keep a temperature (deg C)."""
        self._temperature.append((ns, value))

    def raw(self) -> RawTest:
        """Everything in the order of arrival."""
        status = temperature = None
        if self._status:
            at, dwell, stop = zip(*self._status, strict=True)
            status = RawStatus(np.array(at, np.int64), np.array(dwell), np.array(stop, np.int64))
        if self._temperature:
            at, value = zip(*self._temperature, strict=True)
            temperature = RawTemperature(np.array(at, np.int64), np.array(value))
        ns, omega, force = (np.concatenate(part) for part in zip(*self._samples, strict=True))
        return RawTest(ns, omega, force, status, temperature)
