"""From topics to `LiveCalibration`: holds what has come and hands it over second by second, by stamps.

With a journal, everything is written down before it is processed and acknowledged, and a feed that finds a journal goes
on with it: what its predecessor took is taken again in the same order, and what comes a second time is left out.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator

from sdimu_calibration.core.data.stray_stamps import NEVER
from sdimu_calibration.core.live import NS, EpochEstimate, LiveCalibration
from sdimu_calibration.core.recording import NOMINAL_FROM, DataError
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.nodes.gate import Companion
from sdimu_calibration.nodes.remembered import Remembered
from sdimu_calibration.storage.bags.cdr import LayoutError, decode_imu
from sdimu_calibration.storage.bags.frames import frames_of
from sdimu_calibration.storage.files.journal import Journal, Record, Samples, Status, Temperature

AWAY_S = 600.0
"""Samples that come so long after those of the journal are of another test."""
_SINCE = 100_000
"""Number of messages that are kept until samples say of which test they are, the last ones: four minutes of status and
temperature at 200 Hz each, which repeat what held before them."""


_RENAMED = 500
"""Number of messages without one of the IMU's frame from which it has another name: its driver was started again."""


class Feed:
    """A live calibration and what waits in front of it.

    Stamps stay as the messages have them (ns). Samples enter the filter by whole seconds after the origin, so that the
    counts and estimates published for a second do not depend on how messages arrived.

    Parameters
    ----------
    make : callable
        Makes a `LiveCalibration`.
    journal : Journal, optional
        Where everything is written, instead of memory; what is in it already comes first.
    """

    def __init__(self, make: Callable[[], LiveCalibration], journal: Journal | None = None) -> None:
        self._make = make
        self._journal = journal
        self._before: Remembered | None = None
        self._unsure = False
        self._since: deque[tuple[Callable[..., None], tuple[object, ...]]] = deque(maxlen=_SINCE)
        self.resumed_ns = 0
        self.resumed_s = 0
        """Newest stamp (ns) of the journal, and number of seconds that the filter has done with it."""
        self._raw: list[bytes] = []
        self._live = make()
        self._successor: Feed | None = None
        self._records: Iterator[Record] = iter(())
        self._frame: bytes | None = None
        self._told_frames, self._without = False, 0
        self._told_ns = NEVER
        self._born = time.monotonic()
        self._first_ns: int | None = None
        self.imu_ns = NEVER
        self.status = Companion()
        self.temperature = Companion()
        if journal is not None:
            self._live.kept_by(journal.raw)
            if any(journal.before):
                self._resume(journal)

    def _resume(self, journal: Journal) -> None:
        """Take what the journal holds, second by second as its author did."""
        before = Remembered()
        for record in journal.records():
            if isinstance(record, Samples):
                before.add(record)
            self.resumed_s += self._take_again(record, bool(journal.before.statuses))
        before.settle()
        self._before, self._unsure = before, True
        self.resumed_ns = before.newest_ns

    def _take_again(self, record: Record, speaks: bool) -> int:
        """Take a record as its author did, where a status topic `speaks`; the number of seconds that it completed."""
        if isinstance(record, Status):
            self._note_status(record.ns, record.dwell, record.stop)
        elif isinstance(record, Temperature):
            self._note_temperature(record.ns, record.value)
        else:
            self._keep(record)
            return sum(1 for _ in self._advance(*self.status.reaches(self.imu_ns, speaks)))
        return 0

    def begin_again(self) -> None:
        """Make the filter anew, with what `make` makes now, from the journal; `catch_up` does it piece by piece."""
        assert self._journal is not None
        self._successor = Feed(self._make)
        self._successor._live.kept_by(self._journal.raw)
        self._records = self._journal.records(everything=True)

    def catch_up(self, seconds: float = float("inf")) -> bool:
        """Work for so long (s of wall time) on a filter that is made anew; whether it took the place of the old one.

        Until then the old one goes on, and the new one gets from the journal what comes meanwhile.
        """
        if self._successor is None:
            return False
        until = time.monotonic() + seconds
        speaks = self.status.latest_ns is not None
        for record in self._records:
            self._successor._take_again(record, speaks)
            if time.monotonic() > until:
                return False
        self._live, self._successor = self._successor._live, None
        self._live.notes = []
        return True

    def _forget(self) -> None:
        """Begin anew: what comes is of another test than the journal; what came since counts."""
        assert self._journal is not None
        raw, since = self._raw, self._since
        aside = self._journal.copy_aside()
        self._journal.restart()
        Feed.__init__(self, self._make, self._journal)
        self._live.notes.append(f"the journal was of another test, which did not end; kept as {aside}")
        self._raw = raw
        for action, arguments in since:
            action(*arguments)

    def _is_another_test(self, samples: Samples) -> bool:
        """Whether the first samples after a resumption contradict the journal."""
        if self._before is None or not self._unsure:
            return False
        if int(samples.ns.min()) - self.resumed_ns > AWAY_S * NS or self._before.contradicted(samples):
            return True
        if int(samples.ns.max()) > self.resumed_ns:
            self._unsure = False
            self._since.clear()
        return False

    def take_imu(self, message: bytes) -> None:
        """Keep a raw sensor_msgs/Imu until `decode`."""
        self._raw.append(message)

    @property
    def waiting(self) -> int:
        """Raw samples not yet decoded."""
        return len(self._raw)

    def decode(self) -> int:
        """Decode what waits; the newest stamp (ns), or 0 while there is too little to know the origin."""
        if self._first_ns is None and len(self._raw) <= NOMINAL_FROM:
            return 0
        if not self._raw:
            return self.imu_ns
        raw = self._of_one_frame(self._raw)
        if not raw:
            self._raw = []
            return self.imu_ns
        try:
            ns, omega, force = decode_imu(raw)
        except LayoutError as error:
            raise DataError(f"the IMU topic carries something else than sensor_msgs/Imu ({error})") from error
        samples = Samples(ns, omega, force)
        if self._is_another_test(samples):
            self._forget()
            return self.decode()
        self._raw = []
        if self._before is not None:
            new = ~self._before.repeats(samples)
            samples = Samples(ns[new], omega[new], force[new])
            if not new.any():
                return self.imu_ns
        if self._journal is not None:
            self._journal.samples(samples.ns, samples.omega_ib_b, samples.f_ib_b)
        self._keep(samples)
        return self.imu_ns

    def _of_one_frame(self, raw: list[bytes]) -> list[bytes]:
        """Leave out messages of another `frame_id` than most of the first ones, and say so once."""
        frames = frames_of(raw)
        self._without = 0 if self._frame is None or frames.has(self._frame) else self._without + len(raw)
        if self._frame is None or self._without >= _RENAMED:
            self._frame, self._without = frames.main(), 0
        chosen = frames.chosen(self._frame)
        if chosen is None:
            return raw
        kept, words = chosen
        if not self._told_frames:
            self._told_frames = True
            self._live.notes.append(f"the IMU topic: {words}")
        return [message for message, taken in zip(raw, kept, strict=True) if taken]

    def _keep(self, samples: Samples) -> None:
        self._live.add_samples(samples.ns, samples.omega_ib_b, samples.f_ib_b)
        # Not those of the samples: a stray years ahead would be the newest for the rest of the test.
        if self._first_ns is None and self._live.first_ns != NEVER:
            self._first_ns = self._live.first_ns
        self.imu_ns = max(self.imu_ns, self._live.newest_ns)

    def take_status(self, stamp_ns: int, dwell: bool, stop: int) -> None:
        """Take a status that holds from `stamp_ns` on."""
        if self._journal is not None:
            self._journal.status(stamp_ns, dwell, stop)
            if self._unsure:
                self._since.append((self.take_status, (stamp_ns, dwell, stop)))
        self._note_status(stamp_ns, dwell, stop)

    def _note_status(self, stamp_ns: int, dwell: bool, stop: int) -> None:
        self._live.add_phase(stamp_ns, dwell, stop)
        self.status.take(stamp_ns, time.monotonic(), self.imu_ns)

    def take_temperature(self, stamp_ns: int, value: float) -> None:
        """Take a temperature (deg C)."""
        if self._journal is not None:
            self._journal.temperature(stamp_ns, value)
            if self._unsure:
                self._since.append((self.take_temperature, (stamp_ns, value)))
        self._note_temperature(stamp_ns, value)

    def _note_temperature(self, stamp_ns: int, value: float) -> None:
        self._live.add_temperature(stamp_ns, value)
        self.temperature.take(stamp_ns, time.monotonic(), self.imu_ns)

    def process(
        self, status_published: bool, temperature_published: bool, *, final: bool = False
    ) -> Iterator[EpochEstimate]:
        """Process the whole seconds that samples, status and temperature have passed; all of them when `final`."""
        if self._first_ns is None:
            return
        now = time.monotonic()
        until, known = self.status.allows(self._first_ns, self.imu_ns, status_published, now, self._born)
        warm, _ = self.temperature.allows(self._first_ns, self.imu_ns, temperature_published, now, self._born)
        until = min(until, warm)
        if final:
            until, known = self.imu_ns, self.status.latest_ns is not None
        for estimate in self._advance(until, known, final=final):
            # A filter that was made anew may say of some seconds again what its predecessor said.
            if estimate.ns > self._told_ns:
                self._told_ns = estimate.ns
                yield estimate

    def _advance(self, until_ns: int, known: bool, *, final: bool = False) -> Iterator[EpochEstimate]:
        while (step := self._live.next_ns) is not None and step <= until_ns:
            yield from self._live.advance(step, known)
        if final:
            yield from self._live.advance(until_ns, known, final=True)

    def notes(self) -> list[str]:
        """Return the notes since the last call, such as what the filter waits for."""
        notes, self._live.notes = self._live.notes, []
        return notes

    def finish(self) -> Calibration:
        """Calibrate on everything that has come."""
        if self._first_ns is None:
            raise DataError("the IMU topic: no samples have come; is the IMU running and its topic remapped?")
        self.decode()
        return self._live.finish()
