"""What the user states before a test: the site, the IMU's specification, the model to estimate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

EPOCH_S = 1.0
"""Nominal length of an epoch (s): the paper's measurement rate is 1 Hz."""
LONGEST_EPOCH_S = 10.0
"""Longest epoch (s): the error dynamics of an epoch are expanded in its length; from 15 s on some tests diverge."""
MOST_EPOCHS = 10_000
"""Number of epochs from which those at rest are longer: a test of three hours has as many, and memory and time of an
estimate go with it."""


@dataclass(frozen=True)
class Site:
    """Where the test is made."""

    latitude_rad: float
    height_m: float = 0.0
    """`latitude_rad`, `height_m`: geodetic latitude and ellipsoidal height."""
    gravity_m_s2: float | None = None
    """Measured gravity; None takes WGS-84 normal gravity."""
    initial_azimuth_rad: float | None = None
    """Azimuth of the body X axis (of Y, when X starts within 45 deg of the vertical) at the start; None gyrocompasses.
    """
    initial_azimuth_sigma_rad: float = np.radians(3.0)
    """Its standard deviation; used only with an azimuth."""
    magnetic_field_t: tuple[float, float, float] | None = None
    """North, East, Down (T), for the effects of magnetism; None takes that of mid-northern latitudes."""
    latitude_sigma_rad: float = 0.0
    gravity_sigma_m_s2: float = 0.0
    """`latitude_sigma_rad`, `gravity_sigma_m_s2`: standard deviation of latitude and gravity as they are told; zero
    takes them at their word."""
    deflection_sigma_rad: float = 0.0
    """Standard deviation of the deflection of the vertical in the meridian: astronomic less geodetic latitude."""

    @property
    def astronomic_latitude_sigma_rad(self) -> float:
        """Standard deviation of the latitude as the plumb line has it: the Earth's rate is seen against that."""
        return float(np.hypot(self.latitude_sigma_rad, self.deflection_sigma_rad))

    @property
    def sigmas(self) -> dict[str, float]:
        """Sigmas (rad, m/s^2) by their keys in a file, those that are zero left out."""
        own = self.latitude_sigma_rad, self.deflection_sigma_rad, self.gravity_sigma_m_s2
        keys = "latitude_sigma", "deflection_sigma", "gravity_sigma"
        return {key: sigma for key, sigma in zip(keys, own, strict=True) if sigma}


@dataclass(frozen=True)
class ImuSpecification:
    """An IMU as its data sheet gives it.

    Attributes
    ----------
    gyro_white_noise : float
        Angle random walk as a density (rad/s/sqrt(Hz)): the sigma of a 1 s mean.
    accel_white_noise : float
        Velocity random walk as a density (m/s^2/sqrt(Hz)).
    gyro_random_walk, accel_random_walk : float
        Random walk of the bias (rad/s/sqrt(s), m/s^2/sqrt(s)); 0 where it is not stated. For programs that want it.
    gyro_quantisation, accel_quantisation : float
        Sigma of the angle (rad) or velocity (m/s) that a sample keeps for the next one; 0 for an IMU that keeps none.
    gyro_bias_instability, accel_bias_instability : float
        Bias instability B of the data sheet (rad/s, m/s^2); 0 where it is not stated. Noise with a memory is learned
        from the recording; these say what to expect.
    prior : mapping of str to float
        One-sigma size of every parameter of an effect, by effect name, SI.
    grade : str
        ``navigation``, ``tactical`` or ``mems``: which default priors hold for effects not named.
    prior_units : mapping of str to str
        Unit in which a prior was written, where it was: tells a wrong one.
    file : str
        Where it was read from; empty for one that was not.
    """

    name: str
    gyro_white_noise: float
    accel_white_noise: float
    prior: Mapping[str, float] = field(default_factory=dict)
    grade: str = "navigation"
    prior_units: Mapping[str, str] = field(default_factory=dict)
    gyro_bias_instability: float = 0.0
    accel_bias_instability: float = 0.0
    gyro_random_walk: float = 0.0
    accel_random_walk: float = 0.0
    gyro_quantisation: float = 0.0
    accel_quantisation: float = 0.0
    file: str = field(default="", compare=False)

    @property
    def noise_alone(self) -> ImuSpecification:
        """Name, grade and noise, without priors and file."""
        return replace(self, prior={}, prior_units={}, file="")

    @property
    def place(self) -> str:
        """Where a person finds it: its file, else its name."""
        return self.file or f"IMU '{self.name}'"

    @property
    def epoch_s(self) -> float:
        """Length of an epoch at rest (s) in which quantisation has a third of the variance of the mean, at most.

        White noise gives a mean over T the variance N^2 / T, a residue Q gives it 2 Q^2 / T^2.
        """
        pairs = ((self.gyro_quantisation, self.gyro_white_noise), (self.accel_quantisation, self.accel_white_noise))
        ratio = max((q / n) ** 2 if n > 0.0 else 0.0 for q, n in pairs)
        return float(np.clip(np.ceil(4.0 * ratio), EPOCH_S, LONGEST_EPOCH_S))

    def with_noise_times(self, gyro: float, accel: float) -> ImuSpecification:
        """Return the specification with white noise and quantisation of both triads times a factor."""
        return replace(
            self,
            gyro_white_noise=gyro * self.gyro_white_noise,
            gyro_quantisation=gyro * self.gyro_quantisation,
            accel_white_noise=accel * self.accel_white_noise,
            accel_quantisation=accel * self.accel_quantisation,
        )

    def in_means_over(self, seconds: float) -> ImuSpecification:
        """Return the specification whose white noise gives means over `seconds` their variance, quantisation included.

        `seconds`: length of the means (s).
        """
        gyro = np.sqrt(self.gyro_white_noise**2 + 2.0 * self.gyro_quantisation**2 / seconds)
        accel = np.sqrt(self.accel_white_noise**2 + 2.0 * self.accel_quantisation**2 / seconds)
        return replace(
            self,
            gyro_white_noise=float(gyro),
            accel_white_noise=float(accel),
            gyro_quantisation=0.0,
            accel_quantisation=0.0,
        )


@dataclass(frozen=True)
class StatedPrior:
    """What a model states of one coefficient before the test."""

    name: str
    mean: float
    sigma: float
    """`mean`, `sigma`: in the frame of the report (SI); a sigma of zero fixes the coefficient at the mean."""
    unit: str
    """In which both were written: tells a wrong one; empty where none was, which only a pure number may have."""


@dataclass(frozen=True)
class Model:
    """What is estimated and how the measurements are weighed."""

    effects: tuple[str, ...]
    """Names of registered sensor effects, in the order of the state."""
    velocity_sigma: float = 2e-5
    position_sigma: float = 1e-3
    """`velocity_sigma`, `position_sigma`: one-sigma of "the table stands still, at the known point" per epoch (m/s, m).
    """
    settle_s: float = 1.0
    """Time after the end of motion in which no measurement is taken (s)."""
    body_frame: str = "accelerometer_triad"
    """Frame of the reported coefficients: ``accelerometer_triad`` or ``prior``."""
    zero_velocity: str = "after_motion"
    """When Zp and Zv are taken: ``after_motion`` (once at each stop; later they only repeat what Zf says) or
    ``every_epoch`` (as the paper)."""
    shared_noise: bool = True
    """Model that the same samples drive the navigation and make Zw and Zf."""
    extra_rate_sigma: float = 0.0
    extra_force_sigma: float = 0.0
    """`extra_rate_sigma`, `extra_force_sigma`: noise of Zw and Zf per epoch beyond the IMU's white noise (rad/s,
    m/s^2)."""
    found: tuple[str, ...] = ()
    """Those of `effects` that came to the model because a search or its user found them."""
    priors: tuple[StatedPrior, ...] = ()
    """Of single coefficients, in the place of what the IMU's file says of all of an effect."""
