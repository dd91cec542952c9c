"""White noise beside noise with a memory: neighbouring seconds differ by both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sdimu_calibration.core.evidence.consistency import NO_NOISE, Consistency, Noise
from sdimu_calibration.core.evidence.noise_kernels import Stretches, kernel
from sdimu_calibration.core.noise_term import TRIADS, NoiseTerm
from sdimu_calibration.core.specification import ImuSpecification

_NORMAL_95 = 3.92
"""Width of a 95 % interval (sigma): of a normal distribution."""
_NEIGHBOURS = Stretches(
    np.array([0.0, 1.0]), np.array([1.0, 2.0]), np.zeros(2, dtype=np.int64), np.zeros(2, dtype=np.bool_)
)
"""Two neighbouring seconds of one dwell."""


def without_memory(measured: Consistency, terms: Sequence[NoiseTerm], imu: ImuSpecification) -> Consistency:
    """Take the share of learned noise out of the white noise that neighbouring seconds show.

    Bias instability of the size of the white noise of a second lets neighbouring seconds differ by 1.2 times what
    white noise makes of them.

    Parameters
    ----------
    terms : sequence of NoiseTerm
        Noise with a memory that was learned.
    imu : ImuSpecification
        Whose white noise `measured` was compared with.
    """
    gyro, accel = (
        _without(noise, [t for t in terms if t.triad == triad], density)
        for triad, noise, density in zip(
            TRIADS, (measured.gyro, measured.accel), (imu.gyro_white_noise, imu.accel_white_noise), strict=True
        )
    )
    return replace(measured, gyro=gyro, accel=accel)


def _without(noise: Noise, terms: Sequence[NoiseTerm], density: float) -> Noise:
    share = variance = 0.0
    for term in terms:
        K = kernel(term.kind, term.tau, _NEIGHBOURS)
        # Means over a second of white noise of density N have the variance N^2: their difference has twice that.
        unit = float(K[0, 0] + K[1, 1] - 2.0 * K[0, 1]) / (2.0 * density**2)
        share += unit * term.size**2
        variance += (2.0 * unit * term.size * (term.high - term.low) / _NORMAL_95) ** 2
    if not share or noise is NO_NOISE:
        return noise
    ratio, spread = (float(np.sqrt(max(r**2 - share, 0.0))) for r in (noise.ratio, noise.spread))
    # Of the square of the ratio: that of both shares.
    of_square = np.hypot(2.0 * noise.ratio * noise.sigma, np.sqrt(variance))
    return replace(noise, ratio=ratio, spread=spread, sigma=float(of_square / (2.0 * max(ratio, noise.sigma))))
