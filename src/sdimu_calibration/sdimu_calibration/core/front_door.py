"""The front door of every test, live and offline: samples as they arrived become a recording ready for an estimator.

Stamps are integers (ns) until `arrival.in_order` counts seconds from one origin; nothing turns them back. The steps:

1. samples by their stamps, each stamp once, every number finite (`data.arrival`)
2. units and signs (`data.axes_and_units`), even stamps (`data.dejitter`), one clock (`data.status_clock`)
3. white noise measured at rest, where the user asks for it; quantisation where the rests show it (`noise`)
4. rests without a status (`data.dwell_detection`), latitude, gravity, sign of the force (`data.latitude_check`)

What the data contradict or leave open is told in a note or refused with a question: never silently wrong. Samples that
are no measurement (spikes, stuck sensors) stay: `alignment.prepared` screens them in every estimate.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.data.arrival import IMU_TOPIC
from sdimu_calibration.core.data.attitudes import one_attitude
from sdimu_calibration.core.data.axes_and_units import Stated, recognise
from sdimu_calibration.core.data.dejitter import dejittered
from sdimu_calibration.core.data.dwell_detection import with_detected_dwells
from sdimu_calibration.core.data.imu_class import propose
from sdimu_calibration.core.data.latitude_check import assumption, contradictions, observe_earth_rate, reversed_force
from sdimu_calibration.core.data.status_clock import aligned
from sdimu_calibration.core.data.whole_steps import without_whole_steps
from sdimu_calibration.core.data.why_handheld import why_handheld
from sdimu_calibration.core.noise.quantisation import with_quantisation
from sdimu_calibration.core.recording import DataError, Recording
from sdimu_calibration.core.specification import ImuSpecification, Site
from sdimu_calibration.core.wording import Option, Work

ONE_ATTITUDE = (
    "the IMU is in one attitude all the time: the data show sums of coefficients, and of each one hardly more than the "
    f"IMU's file says; turn it between rests ({Work.NOISE} says what one rest tells)"
)
FEWEST = 100
"""Number of samples below which nothing can be recognised: a second of them."""


@dataclass(frozen=True)
class OpeningOptions:
    """What the user says of a test."""

    imu: ImuSpecification
    site: Site
    assumed_site: str = ""
    """Name of the default site where the user states none; empty for a stated site."""
    stated: Stated = field(default_factory=Stated)
    """Units and signs; what is left out is recognised."""
    handheld: bool | None = None
    """Whether the IMU is moved by hand; None decides by its turns and by the noise of the gyros in the rests."""
    measured_noise: bool = False
    """Replace the white noise of the specification by that of the rests."""
    classes: tuple[ImuSpecification, ...] = ()
    """Where the user states no IMU: what to choose from, as for `imu_class.propose`; `imu` holds until then."""


class OpenedTest(NamedTuple):
    """A test ready for an estimator; `site` is None by hand when the user states none."""

    recording: Recording
    imu: ImuSpecification
    site: Site | None


def in_si(recording: Recording, stated: Stated, where: str = IMU_TOPIC) -> Recording:
    """Bring a recording to SI, right-handed axes, even stamps and one clock.

    Parameters
    ----------
    recording : Recording
        As `in_order` returns it.
    where : str
        File or topic, for errors.

    Returns
    -------
    Recording
        What was recognised and changed is in its notes.
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
    if _constant(recording.f_ib_b).all():
        return None
    for kind, values in (("angular_velocity", recording.omega_ib_b), ("linear_acceleration", recording.f_ib_b)):
        for k in np.flatnonzero(_constant(values)):
            return (
                f"{kind}.{'xyz'[k]} is {values[0, k] + 0.0:.4g} in all {len(values)} samples: the axis is dead; check "
                "the driver"
            )
    return None


def _constant(values: Floats) -> Bools:
    """Axes of `values` (n, 3) that never change, shape (3,); the first samples tell it of most."""
    constant = (values[:FEWEST] == values[0]).all(axis=0)
    return np.asarray((values == values[0]).all(axis=0) if constant.any() else constant)


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
    where : str
        File or topic, for errors.

    Returns
    -------
    OpenedTest
        What was recognised, changed, assumed or contradicted is in the notes of its recording.
    """
    recording, imu = in_si(recording, options.stated, where), options.imu
    if one_attitude(recording):
        recording = replace(recording, notes=(*recording.notes, ONE_ATTITUDE))
    if options.classes:
        imu, note = propose(recording, options.classes)
        recording = replace(recording, notes=(*recording.notes, note))
    if options.measured_noise:
        recording, imu = _with_measured_noise(recording, imu)
    else:
        imu, note = with_quantisation(imu, recording)
        recording = replace(recording, notes=(*recording.notes, note)) if note else recording
    handheld = bool(why_handheld(recording, imu)) if options.handheld is None else options.handheld
    if handheld and options.assumed_site:
        return OpenedTest(recording, imu, None)
    return OpenedTest(_placed(recording, imu, options, where), imu, options.site)


def _with_measured_noise(recording: Recording, imu: ImuSpecification) -> tuple[Recording, ImuSpecification]:
    # The tools of the Allan deviation take time to load, and few tests need them.
    from sdimu_calibration.core.noise.white import with_measured_noise  # noqa: PLC0415

    imu, note = with_measured_noise(imu, recording)
    return replace(recording, notes=(*recording.notes, note)), imu


def _placed(recording: Recording, imu: ImuSpecification, options: OpeningOptions, where: str) -> Recording:
    """Find rests that no status says, and compare the site with the Earth's rate and gravity in the data."""
    site, seen = options.site, None
    if len(recording.t) >= FEWEST:
        recording = without_whole_steps(with_detected_dwells(recording, imu))
        seen = observe_earth_rate(recording.t, recording.omega_ib_b, recording.f_ib_b, imu)
    assumed = options.assumed_site
    notes = [assumption(assumed, site, seen, where)] if assumed else []
    if seen is not None:
        undecided = not assumed and options.stated.accel_sign is None
        if undecided and reversed_force(seen, site):
            raise DataError(
                f"{where}: the Earth turns the wrong way about the specific force for latitude "
                f"{np.degrees(site.latitude_rad):+.1f} deg: either the site is in the other hemisphere (correct the "
                f"sign of its latitude), or the negative of the force was recorded ({Option.ACCEL_SIGN} -1); "
                f"{Option.ACCEL_SIGN} 1 takes both as they are"
            )
        notes += contradictions(seen, site)
    return replace(recording, notes=(*recording.notes, *notes))
