"""White noise for the estimators, measured in the recording.

The estimators take means over a second at rest, so they need the noise of such means: the Allan deviation at one
second. Where the noise is white this is the density of the data sheet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.noise.allan import allan
from sdimu_calibration.core.noise.quantisation import in_words, size_of_residue
from sdimu_calibration.core.noise.rests import rests
from sdimu_calibration.core.recording import DataError, Recording
from sdimu_calibration.core.specification import ImuSpecification
from sdimu_calibration.core.units import from_si

AT_S = 1.0
"""Averaging time at which the noise is read (s): the length of an epoch at rest."""
_LEAST = 0.1
"""Ratio of white noise to the deviation at a second, at least: an IMU has some noise beside its pulses."""


@dataclass(frozen=True)
class WhiteNoise:
    """White noise of both triads."""

    gyro: float
    accel: float
    """`gyro`, `accel`: root mean square of the three axes (rad/s/sqrt(Hz), m/s^2/sqrt(Hz))."""
    gyro_sigma: float
    accel_sigma: float
    """`gyro_sigma`, `accel_sigma`: standard errors."""
    channels: tuple[float, ...]
    """Length 6. Of each sensor; gyros first."""
    rest_s: float
    """Time at rest that was used (s)."""


def white_noise(recording: Recording, rows: Sequence[slice] | None = None) -> WhiteNoise:
    """Measure the white noise in rests of a recording. `rows`: the rests; all that `rests` finds by default."""
    rows = rests(recording) if rows is None else rows
    interval = recording.interval_s
    densities, freedom = [], 1.0
    for data in (recording.omega_ib_b, recording.f_ib_b):
        for axis in range(3):
            found = allan([data[r, axis] for r in rows], interval)
            k = int(np.argmin(np.abs(np.log(found.tau / AT_S))))
            densities.append(float(found.deviation[k] * np.sqrt(found.tau[k])))
            freedom = float(found.freedom[k])
    for triad, own in (("gyro", densities[:3]), ("accelerometer", densities[3:])):
        if not min(own) > 0.0:
            stuck = "xyz"[int(np.argmin(own))]
            raise DataError(f"/imu/data_raw: {triad} {stuck} does not scatter at rest; is it stuck?")
    gyro, accel = (float(np.sqrt(np.mean(np.square(own)))) for own in (densities[:3], densities[3:]))
    share = float(1.0 / np.sqrt(2.0 * 3.0 * freedom))
    rest_s = sum(r.stop - r.start for r in rows) * interval
    return WhiteNoise(gyro, accel, gyro * share, accel * share, tuple(densities), rest_s)


def with_measured_noise(imu: ImuSpecification, recording: Recording) -> tuple[ImuSpecification, str]:
    """Replace the white noise of a specification by that of a recording's rests.

    Returns
    -------
    imu : ImuSpecification
    note : str
        What was measured, and what the specification said.
    """
    rows = rests(recording)
    found = white_noise(recording, rows)
    first, last = np.array([r.start for r in rows]), np.array([r.stop for r in rows])
    kept = [
        size_of_residue(values, first, last, recording.interval_s, white)
        for values, white in ((recording.omega_ib_b, found.gyro), (recording.f_ib_b, found.accel))
    ]
    parts = []
    for word, here, sigma, told, unit in (
        ("gyro", found.gyro, found.gyro_sigma, imu.gyro_white_noise, "deg/h/sqrt(Hz)"),
        ("accelerometer", found.accel, found.accel_sigma, imu.accel_white_noise, "ug/sqrt(Hz)"),
    ):
        value, error, before = (from_si(v, unit) for v in (here, sigma, told))
        parts.append(f"{word} {value:.4g} +- {error:.2g} {unit} ({before:.4g} as specified)")
    gyro, accel = (white_beside(white, Q) for white, Q in zip((found.gyro, found.accel), kept, strict=True))
    note = f"noise as measured in {found.rest_s:.0f} s of rest: {'; '.join(parts)}"
    if any(kept):
        note += f"; of it quantisation of {in_words(*kept)}, which averages out faster than white noise"
    measured = replace(
        imu, gyro_white_noise=gyro, accel_white_noise=accel, gyro_quantisation=kept[0], accel_quantisation=kept[1]
    )
    return measured, note


def white_beside(at_a_second: float, residue: float) -> float:
    """White noise that is left of the Allan deviation at a second beside quantisation.

    Parameters
    ----------
    at_a_second : float
        Allan deviation at 1 s (rad/s or m/s^2).
    residue : float
        Quantisation (rad or m/s).

    Returns
    -------
    float
        Density (rad/s/sqrt(Hz) or m/s^2/sqrt(Hz)); at least `_LEAST` of the deviation.
    """
    return float(np.sqrt(max(at_a_second**2 - 3.0 * residue**2, (_LEAST * at_a_second) ** 2)))
