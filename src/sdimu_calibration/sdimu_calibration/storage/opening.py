"""A recording opened for an estimate: topics found, units and senses recognised, clocks compared, the place checked.

What the data contradict or leave open is said in a note, or asked for: never silently wrong.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from sdimu_calibration.core.data.axes_and_units import Stated, recognise
from sdimu_calibration.core.data.dejitter import dejittered
from sdimu_calibration.core.data.dwell_detection import with_detected_dwells
from sdimu_calibration.core.data.latitude_check import EarthRate, contradictions, observe_earth_rate, reversed_force
from sdimu_calibration.core.data.status_clock import aligned
from sdimu_calibration.core.estimation.handheld_fit import HandheldFit
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import AUTO
from sdimu_calibration.core.handheld.handheld import hides_earth_rate
from sdimu_calibration.core.noise import with_measured_noise
from sdimu_calibration.core.recording import DataError, Recording
from sdimu_calibration.core.specification import ImuSpecification, Site
from sdimu_calibration.core.units import UnitError, parse_unit
from sdimu_calibration.storage.bag_reader import read_recording
from sdimu_calibration.storage.config import load_site
from sdimu_calibration.storage.topic_choice import TopicChoice

DEFAULT_SITE = "daejeon"
_FEWEST = 100
"""Samples below which nothing can be recognised."""


@dataclass(frozen=True)
class Source:
    """What the user says of a recording; everything left out is recognised.

    Attributes
    ----------
    topics : TopicChoice
    accel_unit, gyro_unit : str or None
        Such as ``g`` and ``deg/s``.
    accel_sign, gyro_sign : int or None
        -1 when the negative of the specific force, or of the rate, was recorded.
    """

    topics: TopicChoice = field(default_factory=TopicChoice)
    accel_unit: str | None = None
    gyro_unit: str | None = None
    accel_sign: int | None = None
    gyro_sign: int | None = None

    @property
    def stated(self) -> Stated:
        """The same in SI.

        Raises
        ------
        DataError
            When a unit is none of its kind, or a sign neither 1 nor -1.
        """
        for option, sign in (("--accel-sign", self.accel_sign), ("--gyro-sign", self.gyro_sign)):
            if sign not in {None, 1, -1}:
                raise DataError(f"{option} {sign}: expected 1 or -1")
        return Stated(
            _factor("--accel-unit", self.accel_unit, "m/s^2"), _factor("--gyro-unit", self.gyro_unit, "deg/s"),
            self.accel_sign, self.gyro_sign,
        )  # fmt: skip


def _factor(option: str, unit: str | None, expected: str) -> float | None:
    if unit is None:
        return None
    try:
        parsed = parse_unit(unit)
    except UnitError as error:
        raise DataError(f"{option}: {error}") from error
    if parsed.dimension != parse_unit(expected).dimension:
        raise DataError(f"{option} {unit}: expected a unit such as {expected}")
    return parsed.factor


def open_recording(path: Path, source: Source | None = None) -> Recording:
    """Read a bag and bring it to SI, right-handed axes and one clock.

    Parameters
    ----------
    path : Path
    source : Source, optional

    Returns
    -------
    Recording
        What was recognised and changed is in its notes.

    Raises
    ------
    DataError
        When the bag cannot be used, or physics does not decide and the user has to.
    """
    source = source or Source()
    stated = source.stated
    recording = read_recording(path, source.topics)
    if len(recording.t) < _FEWEST:
        return recording
    dead = _dead(recording)
    if dead is not None:
        raise DataError(f"{path}: {dead}")
    try:
        reading = recognise(recording.t, recording.omega_ib_b, recording.f_ib_b, stated)
    except DataError as error:
        raise DataError(f"{path}: {error}") from error
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


def place(
    recording: Recording, site: str | None, imu: ImuSpecification, source: Source | None = None
) -> tuple[Recording, Site]:
    """Load the place of a test and compare it with what the data show of the Earth; find rests that nobody states.

    Parameters
    ----------
    recording : Recording
    site : str or None
        Name or path; None takes `DEFAULT_SITE` and says so.
    imu : ImuSpecification
    source : Source, optional
        A stated sign of the force is not changed.

    Returns
    -------
    recording : Recording
        With notes; with the force turned round when the Earth's rate at the stated place says that its negative was
        recorded.
    site : Site

    Raises
    ------
    DataError
        When there is no such site.
    """
    where = load_site(site or DEFAULT_SITE)
    recording = with_detected_dwells(recording, imu) if len(recording.t) >= _FEWEST else recording
    seen = (
        observe_earth_rate(recording.t, recording.omega_ib_b, recording.f_ib_b, imu)
        if len(recording.t) >= _FEWEST
        else None
    )
    notes = [] if site is not None else [_assumed(where, seen)]
    if seen is not None:
        may_turn = site is not None and (source is None or source.accel_sign is None)
        if may_turn and reversed_force(seen, where):
            notes.append(
                "specific force is read with the opposite sign: as it stands the Earth turns the wrong way for the "
                "latitude of the site"
            )
            recording = replace(recording, f_ib_b=-recording.f_ib_b)
            seen = replace(seen, up_rate=-seen.up_rate)
        notes += contradictions(seen, where)
    return replace(recording, notes=(*recording.notes, *notes)), where


def _assumed(where: Site, seen: EarthRate | None) -> str:
    text = (
        f"no --site: {DEFAULT_SITE} is assumed (latitude {np.degrees(where.latitude_rad):.1f} deg, height "
        f"{where.height_m:.0f} m)"
    )
    if seen is None or not seen.seen:
        return f"{text}; the data do not show the Earth's rate well enough to say the latitude"
    latitude, sigma = np.degrees(seen.latitude)
    return f"{text}; the Earth's rate in the data is that of latitude {latitude:.0f} +- {sigma:.0f} deg"


def open_test(
    path: Path, site: str | None, imu: ImuSpecification, source: Source | None = None, estimator: str = AUTO,
    measured_noise: bool = False,
) -> PreparedTest:  # fmt: skip
    """Open a recording for an estimate: read, brought to SI and one clock, with its site.

    Parameters
    ----------
    path : Path
        Bag folder or file.
    site : str or None
        Name or path; None takes `DEFAULT_SITE` and says so, or none where a handheld run needs none.
    imu : ImuSpecification
    source : Source, optional
        What the user says of the recording.
    estimator : str
        A handheld estimator, asked for or chosen, does without a site.
    measured_noise : bool
        White noise from the rests of the recording, not from `imu`.

    Raises
    ------
    DataError
        When the bag or the site cannot be used.
    """
    recording = open_recording(path, source)
    if measured_noise:
        imu, note = with_measured_noise(imu, recording)
        recording = replace(recording, notes=(*recording.notes, note))
    handheld = hides_earth_rate(recording, imu) if estimator == AUTO else estimator == HandheldFit.estimator
    where = None
    if site is not None or not handheld:
        recording, where = place(recording, site, imu, source)
    return PreparedTest(recording, imu, where)
