"""Quantisation of an IMU that integrates: noise of the angle or velocity that does not add up.

An IMU that counts pulses (a ring laser gyro, a pulse-rebalanced accelerometer) keeps what is less than a pulse for the
next sample. The integral over any time is then wrong by the same residue Q, and the mean over T by sqrt(2) Q / T where
white noise N gives N / sqrt(T). Dither and vibration of the base, whose angle is bounded too, look the same. An IMU
file that states no quantisation describes means over a second wrongly by a factor of ten and more.

The two-sample (Allan) variance of both is ``3 Q^2 / tau^2 + N^2 / tau`` (IEEE Std 952-1997, annex C). It is read at
averaging times from a fifth of a second to three, between the filter of the sensor and the wander of the bias.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.data.static_detection import resolution, two_sample_variance
from sdimu_calibration.core.data.windows import block_means, runs
from sdimu_calibration.core.noise.rests import TURNING, at_rest
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.core.specification import ImuSpecification
from sdimu_calibration.core.units import from_si

_TAU_S = (0.2, 0.4, 0.8, 1.6, 3.2)
"""Averaging times (s): beyond what a filter in the sensor smooths, below what its bias wanders."""
_PAIRS = 20
"""Number of neighbouring means at an averaging time at least: the variance is then known to a third."""
_SUSPECT = 1.1
"""Ratio of the usual scatter of seconds to that of the specification from which rests are looked at: chance gives 1."""
_MEDIAN_CHI2 = 2.366 / 3.0
"""Ratio of median to mean: of a chi-square of three degrees of freedom."""
_MATTERS = 0.1
"""Ratio of quantisation to white noise in the variance of a one-second mean from which it counts: less is 5 %."""


def with_quantisation(imu: ImuSpecification, recording: Recording) -> tuple[ImuSpecification, str]:
    """Add the quantisation that the rests show to a specification, for a triad of which it states none.

    Returns
    -------
    imu : ImuSpecification
        The same object where the rests show no more than the specification says.
    note : str
        What was added; empty where nothing was.
    """
    stated = {"gyro_quantisation": imu.gyro_quantisation, "accel_quantisation": imu.accel_quantisation}
    white = {"gyro_quantisation": imu.gyro_white_noise, "accel_quantisation": imu.accel_white_noise}
    values = {"gyro_quantisation": recording.omega_ib_b, "accel_quantisation": recording.f_ib_b}
    asked = [name for name, size in stated.items() if not size > 0.0]
    if not asked or not _suspect(recording, [(values[name], white[name]) for name in asked]):
        return imu, ""
    first, last = runs(at_rest(recording))
    found = {name: size_of_residue(values[name], first, last, recording.interval_s, white[name]) for name in asked}
    if not any(found.values()):
        return imu, ""
    note = (
        f"means over a second scatter more than '{imu.name}' says and average out faster than white noise: "
        f"quantisation or vibration of {in_words(**found)} (one sigma) is taken into account"
    )
    gyro, accel = (stated | found).values()
    return replace(imu, gyro_quantisation=gyro, accel_quantisation=accel), note


def in_words(gyro_quantisation: float = 0.0, accel_quantisation: float = 0.0) -> str:
    """Say what each triad keeps for the next sample (rad, m/s), as people read it; nothing of one that keeps none."""
    parts = [f"gyro {from_si(gyro_quantisation, 'arcsec'):.2g} arcsec"] if gyro_quantisation else []
    parts += [f"accelerometer {from_si(accel_quantisation, 'mm/s'):.2g} mm/s"] if accel_quantisation else []
    return " and ".join(parts)


def size_of_residue(values: Floats, first: Ints, last: Ints, interval_s: float, white_noise: float) -> float:
    """Residue Q of a triad where it matters, else zero.

    Parameters
    ----------
    values : ndarray, shape (n, 3)
        Rate or force (rad/s or m/s^2).
    first, last : ndarray of int, shape (k,)
        Samples ``first:last`` of each rest.
    white_noise : float
        Density of the specification (rad/s/sqrt(Hz) or m/s^2/sqrt(Hz)).

    Returns
    -------
    float
        One sigma (rad or m/s), root mean square of the axes.
    """
    tau, variance = _two_sample(values, first, last, interval_s)
    if len(tau) < 2:
        return 0.0
    columns = np.column_stack([3.0 / tau**2, 1.0 / tau]) / variance[:, None]
    Q2, N2 = (float(x) for x in np.linalg.lstsq(columns, np.ones(len(tau)), rcond=None)[0])
    if N2 < 0.0:
        Q2, N2 = float(columns[:, 0].sum() / (columns[:, 0] @ columns[:, 0])), 0.0
    if 0.5 * _MATTERS * max(N2, white_noise**2) >= Q2:
        return 0.0
    # A counter that sees hardly any rate may keep nearly the same residue all through a rest; its next one is another.
    pulse = float(np.max(resolution(values))) * interval_s
    return max(float(np.sqrt(Q2)), pulse / float(np.sqrt(12.0)))


def _two_sample(values: Floats, first: Ints, last: Ints, interval_s: float) -> tuple[Floats, Floats]:
    """Averaging times (k,) (s) and two-sample variance (k,), mean of the axes, of neighbouring means in the rests."""
    tau, variance = [], []
    for width in sorted({max(round(t / interval_s), 1) for t in _TAU_S}):
        found, count = two_sample_variance(values, first, last, width)
        if count >= _PAIRS and found > 0.0:
            tau.append(width * interval_s)
            variance.append(found)
    return np.array(tau), np.array(variance)


def _suspect(recording: Recording, triads: Sequence[tuple[Floats, float]]) -> bool:
    """Whether the means over seconds at rest scatter more than white noise makes them: samples and density of each."""
    width = max(round(1.0 / recording.interval_s), 1)
    seconds = len(recording.t) // width
    if seconds < _PAIRS:
        return False

    rate = block_means(recording.omega_ib_b, width)
    still = np.max(np.abs(rate - np.median(rate, axis=0)), axis=1) < TURNING
    pair = still[1:] & still[:-1]
    if pair.sum() < _PAIRS:
        return False
    for values, noise in triads:
        steps = np.sum(np.diff(block_means(values, width), axis=0)[pair] ** 2, axis=1)
        variance = float(np.median(steps)) / (2.0 * 3.0 * _MEDIAN_CHI2)
        if variance * width * recording.interval_s > _SUSPECT**2 * noise**2:
            return True
    return False
