"""From samples as they arrive to samples in the order of their stamps, every stamp once, every number finite.

Reader and live node use `in_order`, so that a bag and the node that recorded it work on the same samples; there, and
nowhere else, stamps (ns) become the seconds of a recording.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.data.blocks import all_finite, ascending
from sdimu_calibration.core.data.bursts import Bursts, find_bursts
from sdimu_calibration.core.data.clock_steps import Step, as_recorded, find_steps, undone
from sdimu_calibration.core.data.far_samples import TRIADS, far_samples, far_text
from sdimu_calibration.core.data.stray_stamps import stray_note, stray_stamps, strays, strays_note
from sdimu_calibration.core.data.streams import one_stream
from sdimu_calibration.core.note import Note, Topic
from sdimu_calibration.core.plain_text import counted
from sdimu_calibration.core.recording import (
    UNNUMBERED,
    DataError,
    PhaseLog,
    Recording,
    TemperatureLog,
    origin_ns,
    seconds,
)

Stamps = Ints

IMU_TOPIC, STATUS_TOPIC, TEMPERATURE_TOPIC = "/imu/data_raw", "/rate_table/status", "/imu/temperature"
_MINIMUM_SAMPLES = 2
"""Number of samples at least: one has no interval."""
_SAME_TIME = 0.5
"""Distance (intervals) below which two samples are of the same time: neighbours are one interval apart."""
_OVERLAP = 3
"""Number of samples in a row that mean a clock set back, when they arrive late and find their time taken by other
readings: one or two may be stragglers."""

_STREAMS = 20
"""Number of places where stamps go back from which two streams are mixed: a clock is not set so often."""
_COUNTS = ("not_finite", "far", "out_of_order", "repeated")
"""Kinds of samples that are not used, or not in their place: those repeated have a stamp that was there before."""
_COPIES = 0.5
"""Share of the readings with one stamp that are those before once more, from which messages come twice: noise does not
repeat itself."""
_WRONG_STAMPS = 0.2
"""Share of samples with the stamp of another reading that is refused: the others are then no sample times either."""


class RawStatus(NamedTuple):
    """Status messages."""

    ns: Ints
    """Stamps (ns), shape (m,)."""
    dwell: Bools
    """Shape (m,)."""
    stop: Ints
    """`UNNUMBERED` where the message names none, shape (m,)."""


class RawTemperature(NamedTuple):
    """Temperatures."""

    ns: Ints
    """Stamps (ns), shape (m,)."""
    value: Floats
    """deg C, shape (m,)."""


M = TypeVar("M", RawStatus, RawTemperature)


@dataclass(frozen=True)
class RawTest:
    """What the topics of a test brought, in the order of arrival."""

    ns: Ints
    """header.stamp of the samples (ns), shape (n,)."""
    omega_ib_b: Floats
    f_ib_b: Floats
    """`omega_ib_b`, `f_ib_b`: body rate and specific force, in the unit and sign of the messages, shape (n, 3)."""
    status: RawStatus | None = None
    temperature: RawTemperature | None = None
    where: str = IMU_TOPIC
    """File and topic of the IMU, for errors."""
    status_topic: str = STATUS_TOPIC
    temperature_topic: str = TEMPERATURE_TOPIC
    """`status_topic`, `temperature_topic`: for notes."""


def until(raw: RawTest, ns: int) -> RawTest:
    """Return what has a stamp up to `ns`: the same of a test that goes on and of one that has ended.

    Parameters
    ----------
    ns : int
        The last stamp that counts (ns).
    """
    rows = raw.ns <= ns
    return replace(_with_rows(raw, rows), status=_until(raw.status, ns), temperature=_until(raw.temperature, ns))


def _until(messages: M | None, ns: int) -> M | None:
    if messages is None or not (rows := messages.ns <= ns).any():
        return None
    return type(messages)._make(column[rows] for column in messages)


@dataclass(frozen=True)
class Arranged:
    """Which samples to use, and what was wrong with the others."""

    rows: Stamps
    """Indices in the order of their stamps, shape (m,)."""
    counts: dict[str, int]
    """By kind, as in `_COUNTS`."""
    notes: tuple[str, ...]
    """The same for people, one line each."""


def arrange(ns: Stamps, omega_ib_b: Floats, f_ib_b: Floats, where: str) -> Arranged:
    """Choose and order samples.

    Parameters
    ----------
    ns : ndarray of int, shape (n,)
        Stamps (ns) in the order of arrival.
    omega_ib_b, f_ib_b : ndarray, shape (n, 3)
        rad/s, m/s^2.
    where : str
        Named in errors.
    """
    far, notes = _far(ns, omega_ib_b, f_ib_b)
    away = int(np.count_nonzero(far))
    if len(ns) >= _MINIMUM_SAMPLES and not away and ascending(ns) and all_finite(omega_ib_b) and all_finite(f_ib_b):
        return Arranged(np.arange(len(ns)), dict.fromkeys(_COUNTS, 0), ())
    finite = np.isfinite(omega_ib_b).all(axis=1) & np.isfinite(f_ib_b).all(axis=1)
    if not finite.any():
        raise DataError(f"{where}: all {len(ns)} samples are NaN or infinite; check the driver of the IMU")
    rows: Stamps = np.flatnonzero(finite & ~far)
    bad = len(ns) - int(np.count_nonzero(finite))
    if bad:
        notes.append(f"{counted(bad, 'sample was', 'samples were')} not finite and dropped")
    late = int(np.count_nonzero(np.diff(ns[rows]) < 0))
    if late:
        _refuse_clock_set_back(ns[rows], omega_ib_b[rows], f_ib_b[rows], where)
        notes.append(f"{counted(late, 'sample')} came out of order, sorted by their stamps")
        rows = rows[np.argsort(ns[rows], kind="stable")]
    new = np.concatenate([[True], np.diff(ns[rows]) > 0])
    repeated = int(np.count_nonzero(~new))
    if repeated:
        again, before = rows[~new], rows[np.flatnonzero(~new) - 1]
        same = (omega_ib_b[again] == omega_ib_b[before]).all(axis=1) & (f_ib_b[again] == f_ib_b[before]).all(axis=1)
        if np.count_nonzero(~same) > _WRONG_STAMPS * len(rows):
            raise DataError(
                f"{where}: {np.count_nonzero(~same)} of {len(rows)} samples have the stamp of another sample: the "
                "stamps are not the times of the samples; check header.stamp of the driver"
            )
        notes.append(f"{counted(repeated, 'sample')} repeated a stamp, dropped")
    rows = rows[new]
    if len(rows) < _MINIMUM_SAMPLES:
        raise DataError(f"{where}: only one stamp in {len(ns)} samples; check header.stamp of the driver")
    return Arranged(rows, dict(zip(_COUNTS, (bad, away, late, repeated), strict=True)), tuple(notes))


def _far(ns: Stamps, omega_ib_b: Floats, f_ib_b: Floats) -> tuple[Bools, list[str]]:
    """Find samples far beyond all others, and say where they are."""
    interval_s = float(np.median(np.diff(ns))) * 1e-9 if len(ns) > 1 else 0.0
    found = far_samples(interval_s, omega_ib_b, f_ib_b)
    far = found[0] | found[1]
    if not far.any():
        return far, []
    t = (ns - ns[0]) * 1e-9
    first = [
        far_text(name, one, t, x) for name, one, x in zip(TRIADS, found, (omega_ib_b, f_ib_b), strict=True) if one.any()
    ]
    what = counted(int(np.count_nonzero(far)), "sample was", "samples were")
    return far, [f"{what} far beyond all others and dropped ({'; '.join(first)})"]


def _refuse_clock_set_back(ns: Stamps, omega_ib_b: Floats, f_ib_b: Floats, where: str) -> None:
    """Tell samples that came late, and fill a hole, from samples whose times other samples already have."""
    newest = np.maximum.accumulate(ns)
    late = np.flatnonzero(ns < newest)
    before = np.sort(ns)
    interval = float(np.median(np.diff(np.unique(before))))
    order = np.argsort(ns, kind="stable")
    place = np.empty(len(ns), dtype=np.int64)
    place[order] = np.arange(len(ns))
    taken = np.zeros(len(late), dtype=bool)
    for side in (-1, 1):
        other = order[np.clip(place[late] + side, 0, len(ns) - 1)]
        near = np.abs(ns[other] - ns[late]) < _SAME_TIME * interval
        same = (omega_ib_b[other] == omega_ib_b[late]).all(axis=1) & (f_ib_b[other] == f_ib_b[late]).all(axis=1)
        # A sample sent twice is no second reading; only what arrived before this one has taken its time.
        taken |= near & ~same & (other < late)
    late = late[taken]
    if len(late) < _OVERLAP:
        return
    run = np.flatnonzero(late[_OVERLAP - 1 :] - late[: 1 - _OVERLAP] == _OVERLAP - 1)
    if len(run):
        first = int(late[run[0]])
        back_times = int(np.count_nonzero(np.diff(ns) < 0))
        if back_times > _STREAMS:
            raise DataError(
                f"{where}: the stamps go back {back_times} times, and other samples have these times already: two "
                "publishers write to one topic; give each a topic of its own, or stop one"
            )
        back = (newest[first] - ns[first]) * 1e-9 + interval * 1e-9
        raise DataError(
            f"{where}: the clock of the stamps was set back by {back:.3g} s at sample {first} "
            f"({(ns[first] - ns[0]) * 1e-9:.1f} s after the start), so one stamp may mean two times; cut the "
            "recording there, or correct its stamps"
        )


def of_the_test(raw: RawTest) -> tuple[RawTest, tuple[str, ...]]:
    """Leave samples out whose stamps are of no time of the test; the rest, and a note where some were."""
    strays = stray_stamps(raw.ns)
    if not len(strays):
        return raw, ()
    return _with_rows(raw, np.delete(np.arange(len(raw.ns)), strays)), (stray_note(raw.ns[strays]),)


def in_order(raw: RawTest) -> Recording:
    """Order samples and logs by their stamps and count seconds from one nominal interval before the first sample."""
    came = len(raw.ns)
    raw, outside = of_the_test(raw)
    raw, streams = _of_one_sensor(raw)
    bursts = _bursts(raw)
    steps = find_steps(raw.ns, raw.omega_ib_b, raw.f_ib_b) if bursts is None else ()
    raw = _without_steps(raw, steps)
    stamps = raw.ns if bursts is None else bursts.ns
    arranged = arrange(stamps, raw.omega_ib_b, raw.f_ib_b, raw.where)
    notes = [*outside, *streams, *([] if bursts is None else [Note(str(bursts), Topic.JITTER)]), *arranged.notes]
    # Samples that are all there and in order are not copied.
    rows = arranged.rows if any(arranged.counts.values()) else slice(None)
    ns = stamps[rows]
    start_ns = origin_ns(ns)
    return Recording(
        start_ns=start_ns,
        t=seconds(ns, start_ns),
        omega_ib_b=raw.omega_ib_b[rows],
        f_ib_b=raw.f_ib_b[rows],
        phase=_phase(raw, ns, start_ns, notes),
        temperature=_temperature(raw, ns, start_ns, notes),
        rejected=came - len(ns),
        notes=tuple(notes),
        clock_steps=as_recorded(steps, raw.ns, start_ns),
    )


def _with_rows(raw: RawTest, rows: Ints | Bools) -> RawTest:
    return replace(raw, ns=raw.ns[rows], omega_ib_b=raw.omega_ib_b[rows], f_ib_b=raw.f_ib_b[rows])


def _of_one_sensor(raw: RawTest) -> tuple[RawTest, tuple[str, ...]]:
    """Leave the samples of a second publisher out before their stamps are taken for a fault of a clock."""
    rows, notes = one_stream(raw.ns, raw.omega_ib_b, raw.f_ib_b, raw.where)
    if rows is None:
        return raw, notes
    return _with_rows(raw, rows), notes


def _without_steps(raw: RawTest, steps: tuple[Step, ...]) -> RawTest:
    """Take steps of the clock out of the stamps of all topics, which one computer wrote."""
    if not steps:
        return raw
    status, temperature = raw.status, raw.temperature
    return replace(
        raw,
        ns=undone(raw.ns, raw.ns, steps),
        status=status and status._replace(ns=undone(status.ns, raw.ns, steps)),
        temperature=temperature and temperature._replace(ns=undone(temperature.ns, raw.ns, steps)),
    )


def _bursts(raw: RawTest) -> Bursts | None:
    """Even stamps where they come in bursts of readings; messages that were sent twice are none."""
    found = find_bursts(raw.ns)
    if found is None:
        return None
    again = np.flatnonzero(np.diff(raw.ns) == 0)
    copied = (raw.omega_ib_b[again + 1] == raw.omega_ib_b[again]).all(axis=1)
    copied &= (raw.f_ib_b[again + 1] == raw.f_ib_b[again]).all(axis=1)
    return None if len(again) and copied.mean() > _COPIES else found


def _phase(raw: RawTest, samples_ns: Ints, start_ns: int, notes: list[str]) -> PhaseLog | None:
    if raw.status is None or not len(raw.status.ns):
        return None
    order = np.argsort(raw.status.ns, kind="stable")
    order = _without_strays(raw.status.ns, order, samples_ns, raw.status_topic, notes)
    dwell, stop = raw.status.dwell[order], raw.status.stop[order]
    if (stop == UNNUMBERED).any():
        notes.append(f"{raw.status_topic} does not always say the stop: stops are counted from the dwells")
        stop = np.maximum(np.cumsum(dwell & ~np.concatenate([[False], dwell[:-1]])) - 1, 0)
    return PhaseLog(seconds(raw.status.ns[order], start_ns), dwell, stop.astype(np.int64))


def _temperature(raw: RawTest, samples_ns: Ints, start_ns: int, notes: list[str]) -> TemperatureLog | None:
    if raw.temperature is None:
        return None
    ns, value = raw.temperature
    chosen = np.flatnonzero(np.isfinite(value))
    if len(chosen) < len(value):
        notes.append(f"{len(value) - len(chosen)} temperatures of {raw.temperature_topic} were not finite and dropped")
    chosen = chosen[np.unique(ns[chosen], return_index=True)[1]]
    chosen = _without_strays(ns, chosen, samples_ns, raw.temperature_topic, notes)
    return TemperatureLog(seconds(ns[chosen], start_ns), value[chosen]) if len(chosen) else None


def _without_strays(ns: Ints, order: Ints, samples_ns: Ints, topic: str, notes: list[str]) -> Ints:
    """Leave messages of no time of the test out of `order`, rows of `ns` by their stamps, and say so."""
    away = strays(ns[order], samples_ns)
    if away.any():
        notes.append(strays_note(topic, ns[order][away]))
    return order[~away]


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
