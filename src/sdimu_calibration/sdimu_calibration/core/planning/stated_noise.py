"""Sigmas of a plan with the bias instability and random walk that the IMU file states.

White noise averages out over a stop; noise with a memory does not, and most data sheets name it in their first line.
The covariance is that of the fit of a real test in such noise (`estimation.noise_learning`), with nothing to learn.
"""

from __future__ import annotations

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.estimation.filter_fit import FilterFit
from sdimu_calibration.core.estimation.noise_learning import in_noise
from sdimu_calibration.core.evidence.stretch_length import wander_in
from sdimu_calibration.core.noise_term import FLICKER, RANDOM_WALK, NoiseTerm
from sdimu_calibration.core.specification import ImuSpecification


def stated_noise(imu: ImuSpecification) -> tuple[NoiseTerm, ...]:
    """Noise with a memory that an IMU file states."""
    sizes = (
        ("gyro", FLICKER, imu.gyro_bias_instability),
        ("gyro", RANDOM_WALK, imu.gyro_random_walk),
        ("accel", FLICKER, imu.accel_bias_instability),
        ("accel", RANDOM_WALK, imu.accel_random_walk),
    )
    return tuple(NoiseTerm(triad, kind, size=size) for triad, kind, size in sizes if size > 0.0)


def covariance_in(fit: FilterFit, terms: tuple[NoiseTerm, ...]) -> Floats:
    """Covariance of the coefficients of a fit in noise of these terms, biases as means over the test.

    Shape (p, p), in the frame of the prior (SI).
    """
    evidence = fit.bare
    return in_noise(fit, evidence, wander_in(evidence, terms), terms).settled_covariance
