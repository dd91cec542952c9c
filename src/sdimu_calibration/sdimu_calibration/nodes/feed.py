"""From topics to `LiveCalibration`: holds what has come and hands it over second by second, by stamps."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np

from sdimu_calibration.core.live import EpochEstimate, LiveCalibration
from sdimu_calibration.core.recording import NOMINAL_FROM, DataError, Floats, origin_ns
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.nodes.gate import Companion
from sdimu_calibration.storage.cdr import LayoutError, decode_imu

NS = 1_000_000_000


class Feed:
    """A live calibration and what waits in front of it.

    Samples enter the filter in steps that end at whole seconds after the origin, so that the counts and
    estimates published for a second do not depend on how messages arrived.

    Parameters
    ----------
    make : callable
        Makes a `LiveCalibration` from the stamp (ns) from which times count.
    """

    def __init__(self, make: Callable[[int], LiveCalibration]) -> None:
        self._make = make
        self._raw: list[bytes] = []
        self._early: list[tuple[Callable[..., None], tuple[object, ...]]] = []
        self._blocks: list[tuple[Floats, Floats, Floats]] = []
        self._live: LiveCalibration | None = None
        self._step = 1
        self._born = time.monotonic()
        self.start_ns = 0
        self.imu_s = 0.0
        self.status = Companion()
        self.temperature = Companion()

    def take_imu(self, message: bytes) -> None:
        """Keep a raw sensor_msgs/Imu until `decode`."""
        self._raw.append(message)

    @property
    def waiting(self) -> int:
        """Raw samples not yet decoded."""
        return len(self._raw)

    def decode(self) -> int:
        """Decode what waits; the newest stamp (ns), or 0 while there is too little to know the origin.

        Raises
        ------
        DataError
            When messages are not of type Imu.
        """
        if self._live is None and len(self._raw) <= NOMINAL_FROM:
            return 0
        if not self._raw:
            return self.start_ns + round(self.imu_s * NS)
        try:
            ns, omega, force = decode_imu(self._raw)
        except LayoutError as error:
            raise DataError(f"the IMU topic carries something else than sensor_msgs/Imu ({error})") from error
        self._raw = []
        if self._live is None:
            self._begin(origin_ns(ns))
        t: Floats = (ns - self.start_ns).astype(np.float64) * 1e-9
        self._blocks.append((t, omega, force))
        self.imu_s = max(self.imu_s, float(t.max()))
        return self.start_ns + round(self.imu_s * NS)

    def _begin(self, start_ns: int) -> None:
        self.start_ns = start_ns
        self._live = self._make(start_ns)
        for action, arguments in self._early:
            action(*arguments)
        self._early = []

    def take_status(self, stamp_ns: int, dwell: bool, stop: int) -> None:
        """Take a status that holds from `stamp_ns` on."""
        if self._live is None:
            self._early.append((self.take_status, (stamp_ns, dwell, stop)))
            return
        t = (stamp_ns - self.start_ns) * 1e-9
        self._live.add_phase(t, dwell, stop)
        self.status.take(t, time.monotonic())

    def take_temperature(self, stamp_ns: int, value: float) -> None:
        """Take a temperature (deg C)."""
        if self._live is None:
            self._early.append((self.take_temperature, (stamp_ns, value)))
            return
        t = (stamp_ns - self.start_ns) * 1e-9
        self._live.add_temperature(t, value)
        self.temperature.take(t, time.monotonic())

    def process(
        self, status_published: bool, temperature_published: bool, *, final: bool = False
    ) -> Iterator[EpochEstimate]:
        """Process the whole seconds that samples, status and temperature have passed; all of them when `final`."""
        if self._live is None:
            return
        now = time.monotonic()
        until, known = self.status.allows(self.imu_s, status_published, now, self._born)
        warm, _ = self.temperature.allows(self.imu_s, temperature_published, now, self._born)
        until = min(until, warm)
        if final:
            until, known = self.imu_s, self.status.latest_s is not None
        while self._step <= until + 1e-9:
            self._hand_over(float(self._step))
            yield from self._live.advance(float(self._step), known)
            self._step += 1

    def _hand_over(self, until_s: float) -> None:
        """Give the calibration the samples up to a time."""
        assert self._live is not None
        later = []
        for t, omega, force in self._blocks:
            due = t <= until_s + 1e-9
            if due.any():
                self._live.add_samples(t[due], omega[due], force[due])
            if not due.all():
                later.append((t[~due], omega[~due], force[~due]))
        self._blocks = later

    def finish(self) -> Calibration:
        """Calibrate on everything that has come.

        Raises
        ------
        DataError
            When nothing, or too little, has come.
        """
        if self._live is None:
            raise DataError("the IMU topic: no samples have come; is the IMU running and its topic remapped?")
        self.decode()
        self._hand_over(np.inf)
        return self._live.finish()
