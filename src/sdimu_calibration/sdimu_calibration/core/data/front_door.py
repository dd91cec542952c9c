"""The front door of every test, live and offline: samples as they arrived become a recording ready for an estimator.

Stamps are integers (ns) until `in_order` counts seconds from one origin; nothing turns them back. The order of work:

1. samples by their stamps, each stamp once, every number finite (`arrival`)
2. units and signs (`axes_and_units`), even stamps (`dejitter`), one clock (`status_clock`)
3. white noise measured at rest, where the user asks for it (`core.noise`)
4. rests without a status (`dwell_detection`), latitude, gravity and sign of the force (`latitude_check`)

What the data contradict or leave open is told in a note or refused with a question: never silently wrong. Samples that
are no measurement (spikes, stuck sensors) stay: `alignment.prepared` screens them in every estimate.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.data.arrival import arrange
from sdimu_calibration.core.data.axes_and_units import Stated, recognise
from sdimu_calibration.core.data.dejitter import dejittered
from sdimu_calibration.core.data.dwell_detection import with_detected_dwells
from sdimu_calibration.core.data.latitude_check import EarthRate, contradictions, observe_earth_rate, reversed_force
from sdimu_calibration.core.data.static_detection import hides_earth_rate
from sdimu_calibration.core.data.status_clock import aligned
from sdimu_calibration.core.recording import (
    UNNUMBERED,
    DataError,
    PhaseLog,
    Recording,
    TemperatureLog,
    origin_ns,
    seconds,
)
from sdimu_calibration.core.specification import ImuSpecification, Site

FEWEST = 100
"""Samples below which nothing can be recognised."""
IMU_TOPIC, STATUS_TOPIC, TEMPERATURE_TOPIC = "/imu/data_raw", "/rate_table/status", "/imu/temperature"


class RawStatus(NamedTuple):
    """Status messages: stamps (m,) ns, dwell (m,) bool, stop (m,) int (`UNNUMBERED` where the message names none)."""

    ns: Ints
    dwell: Bools
    stop: Ints


class RawTemperature(NamedTuple):
    """Temperatures: stamps (m,) ns, value (m,) deg C."""

    ns: Ints
    value: Floats


@dataclass(frozen=True)
class RawTest:
    """What the topics of a test brought, in the order of arrival.

    Attributes
    ----------
    ns : ndarray of int, shape (n,)
        header.stamp of the samples (ns).
    omega_ib_b, f_ib_b : ndarray, shape (n, 3)
        Body rate and specific force, in the unit and sign of the messages.
    status : RawStatus or None
    temperature : RawTemperature or None
    where : str
        File and topic of the IMU, for errors.
    status_topic, temperature_topic : str
        For notes.
    """

    ns: Ints
    omega_ib_b: Floats
    f_ib_b: Floats
    status: RawStatus | None = None
    temperature: RawTemperature | None = None
    where: str = IMU_TOPIC
    status_topic: str = STATUS_TOPIC
    temperature_topic: str = TEMPERATURE_TOPIC


@dataclass(frozen=True)
class OpeningOptions:
    """What the user says of a test.

    Attributes
    ----------
    imu : ImuSpecification
    site : Site
    assumed_site : str
        Name of the default site where the user states none; empty for a stated site.
    stated : Stated
        Units and signs; what is left out is recognised.
    handheld : bool or None
        Whether the IMU is moved by hand; None decides by the noise of the gyros in the rests.
    measured_noise : bool
        Replace the white noise of the specification by that of the rests.
    """

    imu: ImuSpecification
    site: Site
    assumed_site: str = ""
    stated: Stated = field(default_factory=Stated)
    handheld: bool | None = None
    measured_noise: bool = False


class OpenedTest(NamedTuple):
    """A test ready for an estimator; `site` is None by hand when the user states none."""

    recording: Recording
    imu: ImuSpecification
    site: Site | None


def in_order(raw: RawTest) -> Recording:
    """Order samples and logs by their stamps and count seconds from one nominal interval before the first sample.

    Raises
    ------
    DataError
        When no sample can be used, or the clock of the stamps was set back.
    """
    arranged = arrange(raw.ns, raw.omega_ib_b, raw.f_ib_b, raw.where)
    rows, notes = arranged.rows, [*arranged.notes]
    start_ns = origin_ns(raw.ns[rows])
    return Recording(
        start_ns=start_ns, t=seconds(raw.ns[rows], start_ns),
        omega_ib_b=raw.omega_ib_b[rows], f_ib_b=raw.f_ib_b[rows],
        phase=_phase(raw, start_ns, notes), temperature=_temperature(raw, start_ns, notes),
        rejected=len(raw.ns) - len(rows), notes=tuple(notes),
    )  # fmt: skip


def _phase(raw: RawTest, start_ns: int, notes: list[str]) -> PhaseLog | None:
    if raw.status is None or not len(raw.status.ns):
        return None
    order = np.argsort(raw.status.ns, kind="stable")
    dwell, stop = raw.status.dwell[order], raw.status.stop[order]
    if (stop == UNNUMBERED).any():
        notes.append(f"{raw.status_topic} does not always say the stop: stops are counted from the dwells")
        stop = np.maximum(np.cumsum(dwell & ~np.concatenate([[False], dwell[:-1]])) - 1, 0)
    return PhaseLog(seconds(raw.status.ns[order], start_ns), dwell, stop.astype(np.int64))


def _temperature(raw: RawTest, start_ns: int, notes: list[str]) -> TemperatureLog | None:
    if raw.temperature is None:
        return None
    ns, value = raw.temperature
    chosen = np.flatnonzero(np.isfinite(value))
    if len(chosen) < len(value):
        notes.append(f"{len(value) - len(chosen)} temperatures of {raw.temperature_topic} were not finite and dropped")
    chosen = chosen[np.unique(ns[chosen], return_index=True)[1]]
    return TemperatureLog(seconds(ns[chosen], start_ns), value[chosen]) if len(chosen) else None


def in_si(recording: Recording, stated: Stated, where: str = IMU_TOPIC) -> Recording:
    """Bring a recording to SI, right-handed axes, even stamps and one clock.

    Parameters
    ----------
    recording : Recording
        As `in_order` returns it.
    stated : Stated
    where : str
        File or topic, for errors.

    Returns
    -------
    Recording
        What was recognised and changed is in its notes.

    Raises
    ------
    DataError
        When an axis is dead, or physics contradicts what was stated or does not decide.
    """
    if len(recording.t) < FEWEST:
        return recording
    dead = _dead(recording)
    if dead is not None:
        raise DataError(f"{where}: {dead}")
    try:
        reading = recognise(recording.t, recording.omega_ib_b, recording.f_ib_b, stated)
    except DataError as error:
        raise DataError(f"{where}: {error}") from error
    if reading.accel != 1.0 or reading.gyro != 1.0:
        recording = replace(
            recording, omega_ib_b=recording.omega_ib_b * reading.gyro, f_ib_b=recording.f_ib_b * reading.accel
        )
    recording = replace(recording, notes=(*recording.notes, *reading.notes))
    return _with_temperature(aligned(dejittered(recording)))


def _dead(recording: Recording) -> str | None:
    """Name an axis that shows one number all the time, although the IMU is not a perfect one at rest."""
    if not np.ptp(recording.f_ib_b, axis=0).any():
        return None
    for kind, values in (("angular_velocity", recording.omega_ib_b), ("linear_acceleration", recording.f_ib_b)):
        for axis, x in zip("xyz", values.T, strict=True):
            if x.min() == x.max():
                return f"{kind}.{axis} is {x[0] + 0.0:.4g} in all {len(x)} samples: the axis is dead; check the driver"
    return None


def _with_temperature(recording: Recording) -> Recording:
    """Leave a temperature of another time out: what it was in the test is not known."""
    log = recording.temperature
    if log is None or (log.t[0] < recording.t[-1] and log.t[-1] > 0.0):
        return recording
    note = "the temperature has no time in common with the IMU: not used"
    return replace(recording, temperature=None, notes=(*recording.notes, note))


def open_test(recording: Recording, options: OpeningOptions, where: str = IMU_TOPIC) -> OpenedTest:
    """Make a recording ready for an estimator: all steps after `in_order`.

    Parameters
    ----------
    recording : Recording
        As `in_order` returns it.
    options : OpeningOptions
    where : str
        File or topic, for errors.

    Returns
    -------
    OpenedTest
        What was recognised, changed, assumed or contradicted is in the notes of its recording.

    Raises
    ------
    DataError
        When the data cannot be used, or physics does not decide and the user has to.
    """
    recording, imu = in_si(recording, options.stated, where), options.imu
    if options.measured_noise:
        recording, imu = _with_measured_noise(recording, imu)
    handheld = hides_earth_rate(recording, imu) if options.handheld is None else options.handheld
    if handheld and options.assumed_site:
        return OpenedTest(recording, imu, None)
    return OpenedTest(_placed(recording, imu, options), imu, options.site)


def _with_measured_noise(recording: Recording, imu: ImuSpecification) -> tuple[Recording, ImuSpecification]:
    # The tools of the Allan deviation take time to load, and few tests need them.
    from sdimu_calibration.core.noise.white import with_measured_noise  # noqa: PLC0415

    imu, note = with_measured_noise(imu, recording)
    return replace(recording, notes=(*recording.notes, note)), imu


def _placed(recording: Recording, imu: ImuSpecification, options: OpeningOptions) -> Recording:
    """Find rests that no status says, and compare the site with the Earth's rate and gravity in the data."""
    site, seen = options.site, None
    if len(recording.t) >= FEWEST:
        recording = with_detected_dwells(recording, imu)
        seen = observe_earth_rate(recording.t, recording.omega_ib_b, recording.f_ib_b, imu)
    notes = [_assumed(options.assumed_site, site, seen)] if options.assumed_site else []
    if seen is not None:
        may_turn = not options.assumed_site and options.stated.accel_sign is None
        if may_turn and reversed_force(seen, site):
            notes.append(
                "specific force is read with the opposite sign: as it stands the Earth turns the wrong way for the "
                "latitude of the site"
            )
            recording = replace(recording, f_ib_b=-recording.f_ib_b)
            seen = replace(seen, up_rate=-seen.up_rate)
        notes += contradictions(seen, site)
    return replace(recording, notes=(*recording.notes, *notes))


def _assumed(name: str, site: Site, seen: EarthRate | None) -> str:
    text = (
        f"no --site: {name} is assumed (latitude {np.degrees(site.latitude_rad):.1f} deg, height "
        f"{site.height_m:.0f} m)"
    )
    if seen is None or not seen.seen:
        return f"{text}; the data do not show the Earth's rate well enough to say the latitude"
    latitude, sigma = np.degrees(seen.latitude)
    return f"{text}; the Earth's rate in the data is that of latitude {latitude:.0f} +- {sigma:.0f} deg"
