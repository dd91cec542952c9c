"""Trapezoidal rate profiles on the table's sample grid."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.plan import Turn
from sdimu_calibration.core.recording import DataError

_ON_GRID = 1e-6
"""A time this close to a sample (in samples) is on it: decimal fractions are not exact in binary."""


@dataclass(frozen=True)
class Trapezoid:
    """Rate up, constant, down; every breakpoint is a sample."""

    samples: int
    ramp_samples: int
    """`samples`, `ramp_samples`: length of the turn and of each ramp, in sample intervals."""
    step_s: float
    """Sample interval."""
    angle_rad: float
    """Signed."""

    @property
    def peak_rate(self) -> float:
        """Signed rate between the ramps (rad/s)."""
        return self.angle_rad / ((self.samples - self.ramp_samples) * self.step_s)

    @property
    def acceleration(self) -> float:
        """Magnitude of the angular acceleration in the ramps (rad/s^2)."""
        return abs(self.peak_rate) / (self.ramp_samples * self.step_s)

    def angle_and_rate(self) -> tuple[Floats, Floats]:
        """Angle (rad) and rate (rad/s) at samples 0 ... `samples`, shapes (samples + 1,).

        Counted in samples from the nearer end, so that the last angle is the turn's to the last digit.
        """
        k = np.arange(self.samples + 1)
        to_end = np.minimum(k, self.samples - k)
        ramp = np.minimum(to_end, self.ramp_samples)
        part = (ramp**2 / (2.0 * self.ramp_samples) + (to_end - ramp)) / (self.samples - self.ramp_samples)
        angle = self.angle_rad * np.where(2 * k <= self.samples, part, 1.0 - part)
        return angle, self.peak_rate * ramp / self.ramp_samples


def trapezoid(turn: Turn, acceleration_rad_s2: float, sample_rate_hz: float, number: int) -> Trapezoid:
    """Profile of one turn at its mean rate.

    With angle A, length T = A / mean rate and ramps of t_r at acceleration a the area is
    ``A = w_p (T - t_r)``, ``w_p = a t_r``: the smaller root t_r, then rounded up to the grid, which lowers the
    acceleration and keeps T.

    `acceleration_rad_s2`: limit; `number`: of the turn in the plan, from 1, for the error message.
    """
    size = abs(turn.angle_rad)
    samples = round(size / turn.rate_rad_s * sample_rate_hz)
    length = samples / sample_rate_hz
    root = length**2 - 4.0 * size / acceleration_rad_s2
    ramp = 0.0
    if root >= 0.0:
        # (T - sqrt(T^2 - 4A/a)) / 2 without the cancellation for gentle turns.
        ramp = 2.0 * size / acceleration_rad_s2 / (length + math.sqrt(root)) if length else 0.0
    ramp_samples = math.ceil(ramp * sample_rate_hz - _ON_GRID)
    if root < 0.0 or ramp_samples < 1 or 2 * ramp_samples > samples:
        raise DataError(
            f"turn {number}: {math.degrees(turn.angle_rad):g} deg about {turn.axis} at a mean of "
            f"{math.degrees(turn.rate_rad_s):g} deg/s needs more than the limit of "
            f"{math.degrees(acceleration_rad_s2):g} deg/s^2 (lower the rate or raise the acceleration)"
        )
    return Trapezoid(samples, ramp_samples, 1.0 / sample_rate_hz, turn.angle_rad)
