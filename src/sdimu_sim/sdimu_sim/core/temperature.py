"""Temperature of the IMU over a test: what its thermometer shows, and what its sensors follow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_sim.core.truth import child_rng


@dataclass(frozen=True)
class TemperatureProfile:
    """Chamber, self-heating and ripple: ``T(t) = chamber(t) + rise (1 - exp(-t / tau)) + ripple sin(2 pi t / period)``.

    The sensors follow the thermometer with a first-order lag, ``lag dTs/dt = T - Ts``; at t = 0 both have the same
    temperature.
    """

    start_degc: float = 25.0
    """Of the chamber at t = 0 (deg C)."""
    rise: float = 0.0
    tau_s: float = 1200.0
    """`rise`, `tau_s`: self-heating (K) and its time constant (s)."""
    ripple: float = 0.0
    ripple_period_s: float = 600.0
    """`ripple`, `ripple_period_s`: of the air conditioning (K, s)."""
    knots: tuple[tuple[float, float], ...] = ()
    """Times (s, ascending, from 0) and temperatures (deg C) between which the chamber goes straight; constant after the
    last. Empty: constant at `start_degc`."""
    reference_degc: float | None = None
    """Temperature T0 for which the coefficients are stated (deg C); None: that at t = 0."""
    sensor_lag_s: float = 0.0
    """Lag of the sensors behind the thermometer (s)."""
    offset: float = 0.0
    noise: float = 0.0
    resolution: float = 0.0
    """`offset`, `noise`, `resolution`: of the thermometer: error (K), white noise of a reading (K, one sigma), step of
    its output (K; 0 for none)."""

    @property
    def origin_degc(self) -> float:
        """Temperature T0 for which the coefficients are stated (deg C)."""
        return float(self.value(np.zeros(1))[0]) if self.reference_degc is None else self.reference_degc

    def value(self, t: Floats) -> Floats:
        """Temperature at the thermometer (deg C), free of its errors, at times (s)."""
        swing = self.ripple * np.sin(2.0 * np.pi / self.ripple_period_s * t)
        result: Floats = self._chamber(t) + self.rise * -np.expm1(-t / self.tau_s) + swing
        return result

    def rate(self, t: Floats) -> Floats:
        """Its derivative (K/s)."""
        omega = 2.0 * np.pi / self.ripple_period_s
        result: Floats = self.rise / self.tau_s * np.exp(-t / self.tau_s) + self.ripple * omega * np.cos(omega * t)
        if self.knots:
            times, slopes = self._slopes()
            result = result + slopes[np.searchsorted(times, t, side="right") - 1]
        return result

    def sensor_value(self, t: Floats) -> Floats:
        """Temperature of the sensors (deg C) at times (s): the lag's response to each part, in closed form."""
        lag = self.sensor_lag_s
        if lag <= 0.0:
            return self.value(t)
        # Equal time constants are the limit of unequal ones.
        tau = self.tau_s * (1.0 + 1e-6) if np.isclose(self.tau_s, lag, rtol=1e-6) else self.tau_s
        fading = np.exp(-t / lag)
        warmed = 1.0 - (tau * np.exp(-t / tau) - lag * fading) / (tau - lag)
        omega = 2.0 * np.pi / self.ripple_period_s
        swing = np.sin(omega * t) - omega * lag * (np.cos(omega * t) - fading)
        result: Floats = (
            self._chamber(t) - self._behind(t) + self.rise * warmed + self.ripple * swing / (1.0 + (omega * lag) ** 2)
        )
        return result

    def sensor_rate(self, t: Floats) -> Floats:
        """Its derivative (K/s)."""
        if self.sensor_lag_s <= 0.0:
            return self.rate(t)
        result: Floats = (self.value(t) - self.sensor_value(t)) / self.sensor_lag_s
        return result

    def _chamber(self, t: Floats) -> Floats:
        if not self.knots:
            return np.full(np.shape(t), self.start_degc)
        times, values = np.array(self.knots).T
        return np.asarray(np.interp(t, times, values))

    def _slopes(self) -> tuple[Floats, Floats]:
        """Return the times of the knots (s) and the slope behind each (K/s)."""
        times, values = np.array(self.knots).T
        return times, np.append(np.diff(values) / np.diff(times), 0.0)

    def _behind(self, t: Floats) -> Floats:
        """How far the sensors lag behind the chamber (K): between knots ``slope lag`` and a transient to it."""
        if not self.knots:
            return np.zeros(np.shape(t))
        (times, slopes), lag = self._slopes(), self.sensor_lag_s
        at = np.zeros(len(times))
        for k, interval in enumerate(np.diff(times)):
            at[k + 1] = slopes[k] * lag + (at[k] - slopes[k] * lag) * np.exp(-interval / lag)
        last = np.searchsorted(times, t, side="right") - 1
        steady = slopes[last] * lag
        result: Floats = steady + (at[last] - steady) * np.exp(-(t - times[last]) / lag)
        return result


class Thermometer:
    """What is published of a profile: its readings one after another, the same digits however they are asked for."""

    def __init__(self, profile: TemperatureProfile, seed: int) -> None:
        self._profile = profile
        self._rng = child_rng(seed, "thermometer")

    def read(self, t: Floats) -> Floats:
        """Next readings (deg C) at times (s)."""
        profile = self._profile
        values = profile.value(t) + profile.offset
        if profile.noise:
            values = values + profile.noise * self._rng.standard_normal(len(t))
        if profile.resolution:
            values = profile.resolution * np.round(values / profile.resolution)
        return values
