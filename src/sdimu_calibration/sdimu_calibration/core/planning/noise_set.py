"""A named set of noise assumptions of a filter, as distinct from the noise of the IMU."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import ImuSpecification, Model


@dataclass(frozen=True)
class NoiseSet:
    """Process noise Q, measurement noise R and initial attitude of a filter."""

    name: str
    gyro_density: float
    accel_density: float
    """`gyro_density`, `accel_density`: Q: white noise that drives the navigation (rad/s/sqrt(Hz), m/s^2/sqrt(Hz))."""
    rate_sigma: float
    force_sigma: float
    """`rate_sigma`, `force_sigma`: R of Zw and Zf: one sigma of the mean over a second (rad/s, m/s^2); not below the
    densities."""
    velocity_sigma: float
    position_sigma: float
    """`velocity_sigma`, `position_sigma`: R of Zv and Zp (m/s, m)."""
    zero_velocity: str
    """``every_epoch`` or ``after_motion``."""
    shared_noise: bool
    """Whether the correlation of process and measurement noise is modelled."""
    level_sigma: float
    azimuth_sigma: float
    """`level_sigma`, `azimuth_sigma`: initial attitude (rad)."""
    reference: str = ""
    """Name of the published results that it was made to reproduce; empty for none."""


def apply(noise: NoiseSet, imu: ImuSpecification, model: Model) -> tuple[ImuSpecification, Model]:
    """IMU and model with the noise of a set in place of their own."""
    for what, sigma, density in (
        ("rate_sigma", noise.rate_sigma, noise.gyro_density),
        ("force_sigma", noise.force_sigma, noise.accel_density),
    ):
        if sigma < density:
            raise DataError(f"noise set '{noise.name}': {what} is below the process noise over one second")
    told = replace(imu, gyro_white_noise=noise.gyro_density, accel_white_noise=noise.accel_density)
    return told, replace(
        model,
        velocity_sigma=noise.velocity_sigma,
        position_sigma=noise.position_sigma,
        zero_velocity=noise.zero_velocity,
        shared_noise=noise.shared_noise,
        extra_rate_sigma=float(np.sqrt(noise.rate_sigma**2 - noise.gyro_density**2)),
        extra_force_sigma=float(np.sqrt(noise.force_sigma**2 - noise.accel_density**2)),
    )
