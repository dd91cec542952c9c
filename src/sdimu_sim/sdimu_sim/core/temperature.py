"""Temperature of the IMU over a test."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats


@dataclass(frozen=True)
class TemperatureProfile:
    """``T(t) = start + rise (1 - exp(-t / tau)) + ripple sin(2 pi t / period)``, in deg C and s."""

    start_degc: float = 25.0
    rise: float = 0.0
    tau_s: float = 1200.0
    ripple: float = 0.0
    ripple_period_s: float = 600.0

    def value(self, t: Floats) -> Floats:
        """Temperature (deg C) at times (s)."""
        swing = self.ripple * np.sin(2.0 * np.pi / self.ripple_period_s * t)
        result: Floats = self.start_degc + self.rise * -np.expm1(-t / self.tau_s) + swing
        return result

    def rate(self, t: Floats) -> Floats:
        """Its derivative (K/s)."""
        omega = 2.0 * np.pi / self.ripple_period_s
        result: Floats = self.rise / self.tau_s * np.exp(-t / self.tau_s) + self.ripple * omega * np.cos(omega * t)
        return result
