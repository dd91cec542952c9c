"""White noise as the recording shows it, where the IMU file is wrong about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from sdimu_calibration.core.data.imu_class import other_grade
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.noise_learning import in_noise
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.evidence.consistency import Consistency, Noise
from sdimu_calibration.core.noise_term import FLICKER, RANDOM_WALK, NoiseTerm
from sdimu_calibration.core.note import Note, Topic, topic_of
from sdimu_calibration.core.progress import Progress, silent
from sdimu_calibration.core.specification import ImuSpecification

NOISE_OFF = 0.05
"""Deviation of the white noise from its specification, as a share, from which it is reported and corrected: all sigmas
go with it."""
_KURTOSIS = 4.0
"""Kurtosis of the differences of neighbouring seconds (1) from which tails are heavy: Gaussian noise in a test of an
hour stays below 3.3."""


def is_stated(term: NoiseTerm, imu: ImuSpecification) -> bool:
    """Whether a term of noise is what an IMU file states, within its 95 % interval: then the file is not wrong."""
    size = {
        ("gyro", FLICKER): imu.gyro_bias_instability,
        ("accel", FLICKER): imu.accel_bias_instability,
        ("gyro", RANDOM_WALK): imu.gyro_random_walk,
        ("accel", RANDOM_WALK): imu.accel_random_walk,
    }.get((term.triad, term.kind))
    return size is not None and 0.0 < term.low <= size <= term.high


def in_measured_noise(fit: Fit, progress: Progress = silent) -> tuple[Fit, Consistency, tuple[str, ...]]:
    """Fit in white noise, of the size that the recording shows where the IMU file is wrong about it.

    Returns
    -------
    fit : Fit
    consistency : Consistency
        Of the fit as it was given.
    noise : tuple of str
        What is wrong in the IMU file, one line each.
    """
    consistency = fit.consistency()
    noise, imu = measured_noise(consistency, fit)
    if noise:
        test = fit.test
        wrong = other_grade(test.recording, test.imu, test.known_imus)
        noise = (*([Note(wrong, Topic.OTHER_GRADE)] if wrong else []), *noise)
        again = solve(
            fit.test.with_imu(imu),
            fit.model,
            fit.estimator,
            progress=progress,
            learn=False,
            azimuth_free=fit.azimuth_free,
        )
        fit = replace(again, reason=fit.reason)
    return in_noise(fit, ()), consistency, noise


def of_other_grade(noise: Sequence[str]) -> tuple[str, ...]:
    """Lines on the noise that say that the IMU's file is of another grade."""
    return tuple(line for line in noise if topic_of(line) == Topic.OTHER_GRADE)


def is_off(noise: Noise) -> bool:
    """Whether the white noise of a triad is not as specified, by more than chance and by what counts."""
    return abs(noise.ratio - 1.0) > max(NOISE_OFF, 4.0 * noise.sigma)


def measured_noise(consistency: Consistency, fit: Fit) -> tuple[tuple[str, ...], ImuSpecification]:
    """Say where the white noise is not as specified, and put the measured one in its place.

    Noise with heavy tails is taken at its standard deviation, outliers and all. To leave the outliers out of the
    measurements instead would be wrong: the same samples drive the navigation, and it is the measurement that
    tells the filter what they did to it.
    """
    told: list[str] = []
    scales = {"gyro": 1.0, "accel": 1.0}
    for triad, noise in (("gyro", consistency.gyro), ("accel", consistency.accel)):
        if is_off(noise):
            scales[triad] = noise.ratio
            told.append(f"{triad} white noise is {noise.ratio:.2f} +- {noise.sigma:.2f} times the specification")
        if noise.kurtosis > _KURTOSIS:
            scales[triad] = noise.spread
            share = 100 * len(noise.outliers) / max(1, consistency.seconds)
            told.append(
                f"{triad} noise has heavy tails: kurtosis {noise.kurtosis:.1f} (3 is Gaussian), {share:.1f} % of the "
                f"seconds are outliers, with them it is {noise.spread:.2f} times the specification"
            )
    return tuple(told), fit.test.imu.with_noise_times(**scales)
