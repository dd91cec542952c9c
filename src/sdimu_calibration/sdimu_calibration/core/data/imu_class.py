"""Which of some IMU files a recording is of, where nobody states one: told by the noise and the biases of its rests.

Noise tells the grade of the gyros and no more. A file whose limits of rest the rests exceed is none of theirs:
the next coarser one is taken. What is taken in place of the default, or in more noise than the default's, has the
priors of its grade, wider where the rests show larger biases, and the noise of the rests.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.data.phases import rest_limits
from sdimu_calibration.core.data.static_detection import StaticIntervals, detect_static, two_sample_variance
from sdimu_calibration.core.effects.bias import ACCEL_BIAS, GYRO_BIAS
from sdimu_calibration.core.recording import DataError, Recording
from sdimu_calibration.core.specification import ImuSpecification
from sdimu_calibration.core.units import STANDARD_GRAVITY, from_si
from sdimu_calibration.core.wording import Option

KnownImus = Callable[[], Sequence[ImuSpecification]]
"""Gives the files of IMUs that may be named; none are read before one is asked for."""
_TAU_S = (2.0, 8.0)
"""Averaging times (s) beside the half second of static detection: long enough for pulses of a ring laser gyro."""
_FEWEST = 20
"""Number of differences of neighbouring means at least: of three axes they give the noise to a tenth."""
_BY_CHANCE = 4.0
"""Distance (sigma) by which noise over a longer time is below that of a shorter one to count: the least of three
numbers is else too small by chance, and the model then seems not to fit."""
_AS_STATED = 1.3
"""Ratio of noise to that of the default up to which the default's is taken: units of one type differ by less."""


_FAR_ABOVE = 2.5
"""Ratio of the noise of rests to the stated one from which the file is at fault: a table that vibrates hardly doubles
what an IMU of the file would show."""


@dataclass(frozen=True)
class RestsShown:
    """What the rests show of an IMU."""

    gyro_noise: float
    accel_noise: float
    """`gyro_noise`, `accel_noise`: white noise (rad/s/sqrt(Hz), m/s^2/sqrt(Hz))."""
    rate: float
    """Median size of the mean rate of a rest (rad/s): bias and Earth."""
    force_error: float
    """Median difference of the mean specific force of a rest from gravity (m/s^2)."""
    largest_force_error: float
    """The largest of these differences (m/s^2)."""

    def __str__(self) -> str:
        """Return it in customary units."""
        return (
            f"noise {from_si(self.gyro_noise, 'deg/h/sqrt(Hz)'):.2g} deg/h/sqrt(Hz) and "
            f"{from_si(self.accel_noise, 'ug/sqrt(Hz)'):.2g} ug/sqrt(Hz), mean rate "
            f"{from_si(self.rate, 'deg/h'):.2g} deg/h, force {from_si(self.force_error, 'mg'):.2g} mg from gravity"
        )

    def beside(self, imu: ImuSpecification) -> list[tuple[str, float]]:
        """Give the noise of gyros and accelerometers beside the stated one, in words and as their ratio (1)."""
        pairs = (
            ("gyros", self.gyro_noise, imu.gyro_white_noise, "deg/h/sqrt(Hz)"),
            ("accelerometers", self.accel_noise, imu.accel_white_noise, "ug/sqrt(Hz)"),
        )
        return [
            (
                f"{whose} show {from_si(seen, unit):.2g} {unit} at rest where {imu.name} states "
                f"{from_si(stated, unit):.2g}",
                seen / stated,
            )
            for whose, seen, stated, unit in pairs
        ]

    def fits(self, imu: ImuSpecification) -> bool:
        """Whether an IMU of a specification may rest like this."""
        limits = rest_limits(imu)
        return self.rate < limits.rate and self.force_error < limits.force

    def no_noisier_than(self, imu: ImuSpecification) -> bool:
        """Whether the white noise of the rests is that of a specification, or less."""
        pairs = ((self.gyro_noise, imu.gyro_white_noise), (self.accel_noise, imu.accel_white_noise))
        return all(seen < _AS_STATED * stated for seen, stated in pairs)

    def of_class(self, imu: ImuSpecification) -> ImuSpecification:
        """Return a specification with this noise and with priors that allow these biases."""
        seen = {
            GYRO_BIAS.name: max(self.rate - earth.RATE, 0.0),
            # A bias shows in |f| by its part along gravity.
            ACCEL_BIAS.name: 2.0 * self.largest_force_error,
        }
        wider = {name: max(imu.prior.get(name, 0.0), size) for name, size in seen.items()}
        return replace(
            imu, gyro_white_noise=self.gyro_noise, accel_white_noise=self.accel_noise, prior={**imu.prior, **wider}
        )


def shown_at_rest(recording: Recording) -> RestsShown | None:
    """Look at the rests of a recording; None when there is none.

    Parameters
    ----------
    recording : Recording
        In SI.
    """
    try:
        found = detect_static(recording)
    except DataError:
        return None
    rate, force = (
        np.linalg.norm([data[a:b].mean(axis=0) for a, b in zip(found.first, found.last, strict=True)], axis=1)
        for data in (recording.omega_ib_b, recording.f_ib_b)
    )
    gyro, accel = (
        _white_noise(data, found, recording.interval_s, usual)
        for data, usual in ((recording.omega_ib_b, found.gyro_white_noise), (recording.f_ib_b, found.accel_white_noise))
    )
    error = np.abs(force - STANDARD_GRAVITY)
    return RestsShown(gyro, accel, float(np.median(rate)), float(np.median(error)), float(error.max()))


def understated_noise(recording: Recording, imu: ImuSpecification, known: KnownImus = tuple) -> str:
    """Say that the rests are far noisier than a specification states; empty where they are not, or there is no rest.

    Parameters
    ----------
    recording : Recording
        In SI.
    known : callable
        Gives the files of other IMUs, of which one may fit.

    Returns
    -------
    str
        A part of a sentence: what is measured against what is stated, and what to do.
    """
    shown = shown_at_rest(recording)
    told = [] if shown is None else [text for text, ratio in shown.beside(imu) if ratio > _FAR_ABOVE]
    if shown is None or not told:
        return ""
    remedy = _fitting(shown, known()) or f"take {Option.NOISE} estimated"
    return f"the likely cause is the noise in the IMU's file: {', '.join(told)}; {remedy}"


def other_grade(recording: Recording, imu: ImuSpecification, known: KnownImus) -> str:
    """Say that a specification is of an IMU of another grade than the rests; empty where it is not.

    A file that states far more noise than there is counts only where a known one fits: units are often better than
    their data sheets.

    Parameters
    ----------
    recording : Recording
        In SI.
    known : callable
        Gives the files of other IMUs, of which one may fit.
    """
    shown = shown_at_rest(recording)
    if shown is None:
        return ""
    beside = shown.beside(imu)
    above = [text for text, ratio in beside if ratio > _FAR_ABOVE]
    below = [text for text, ratio in beside if ratio * _FAR_ABOVE < 1.0]
    remedy = _fitting(shown, known()) if above or below else ""
    if not remedy and not above:
        return ""
    return f"{', '.join([*above, *below])}; {remedy or f'take {Option.NOISE} estimated'}"


def _fitting(shown: RestsShown, known: Sequence[ImuSpecification]) -> str:
    """Advise to take the file whose noise and limits of rest are those of the rests, the nearest; empty for none."""

    def distance(imu: ImuSpecification) -> float:
        return float(np.max(np.abs(np.log([ratio for _, ratio in shown.beside(imu)]))))

    fit = [imu for imu in known if shown.fits(imu) and distance(imu) < np.log(_FAR_ABOVE)]
    if not fit:
        return ""
    name = min(fit, key=distance).name
    return f"the IMU is probably of another grade: {name} fits ({Option.IMU} {name}), or take {Option.NOISE} estimated"


def _white_noise(values: Floats, rests: StaticIntervals, interval_s: float, usual: float) -> float:
    """Noise density of a triad: `usual`, or that of neighbouring means over each of `_TAU_S` where it is clearly less.

    Quantisation and vibration let it fall with the length of the means, a wandering bias lets it rise: the least one is
    nearest to white noise.
    """
    least = usual
    for tau in _TAU_S:
        width = max(round(tau / interval_s), 1)
        variance, count = two_sample_variance(values, rests.first, rests.last, width)
        if count >= _FEWEST:
            density = float(np.sqrt(variance * width * interval_s))
            # Of `count` differences of three axes, neighbours correlated by a half, the share of one sigma.
            chance = 0.5 / np.sqrt(count)
            least = density if density * (1.0 + _BY_CHANCE * chance) < least else least
    return least


def propose(recording: Recording, classes: Sequence[ImuSpecification]) -> tuple[ImuSpecification, str]:
    """Choose the IMU file that a recording is probably of.

    Parameters
    ----------
    recording : Recording
        In SI.
    classes : sequence of ImuSpecification
        From the finest gyros to the coarsest, one of each grade; the first is taken where nothing tells.

    Returns
    -------
    imu : ImuSpecification
        One of `classes`; with the noise and the biases of the rests where it is not the first, or they are noisier.
    note : str
        What was assumed, and why.
    """
    shown = shown_at_rest(recording)
    if shown is None:
        return classes[0], f"no {Option.IMU}: {classes[0].name} is assumed; no rest shows what IMU it is"
    # Half way between two grades, in the ratio of their noise.
    borders = [np.sqrt(a.gyro_white_noise * b.gyro_white_noise) for a, b in pairwise(classes)]
    grade = int(np.searchsorted(borders, shown.gyro_noise))
    while grade < len(classes) - 1 and not shown.fits(classes[grade]):
        grade += 1
    imu = classes[grade]
    as_it_is = grade == 0 and shown.no_noisier_than(imu)
    with_what = "" if as_it_is else " with this noise and priors for such biases"
    note = (
        f"no {Option.IMU}: {imu.name} is assumed{with_what}, as the rests show {shown}; state your own file if there "
        "is one"
    )
    return (imu if as_it_is else shown.of_class(imu)), note
