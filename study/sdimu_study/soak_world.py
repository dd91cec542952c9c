"""Soaks and ramps of one unit whose every coefficient is a polynomial of the temperature, and what is true there."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effect_key import sized
from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.recording import DataError, Recording
from sdimu_calibration.core.rotation import rotation_vector
from sdimu_calibration.core.specification import ImuSpecification, Site
from sdimu_calibration.storage.files.config import load_model
from sdimu_sim.core.hidden import parse_effects, size_unit
from sdimu_sim.core.scenario import Scenario, imu_truth
from sdimu_sim.core.temperature import TemperatureProfile
from sdimu_sim.core.true_coefficients import POWERS, accelerometer_frames
from sdimu_sim.core.truth import ImuTruth
from sdimu_study.set_world import Unit
from sdimu_study.worlds import simulate

SOAKS_DEGC = (-40.0, -10.0, 20.0, 45.0, 70.0)
"""Temperatures of the soaks (deg C): the range of a ramp, and near room temperature."""
T0_DEGC = 25.0
"""Temperature from which the coefficients count (deg C): that of a room, as data sheets state it."""
_RAMP_K_S = 2.0 / 60.0
"""Rate of the ramps (K/s): that of an ordinary chamber."""
_HOLD_S = 300.0
"""Time before and after a ramp at constant temperature (s)."""
_NOISE_K, _STEP_K = 0.02, 0.01
"""Noise of a reading of the thermometer (K), and step of its output (K): of a platinum resistor with its converter."""
TURN_ON = (0.01, 0.1)
"""Scatter of both biases from power-on to power-on: least and largest share of the prior of the bias (1)."""
BLOCK_S = 10.0
"""Time over which compensated samples are averaged (s): long enough for errors of the calibration to stand out."""
_GRID_K = np.linspace(-80.0, 60.0, 281)
"""Temperatures above T0 (K) at which the turn of the accelerometers' frame is worked out: beyond every profile, so
close that its curve between two of them is below 1e-12 rad."""


def polynomials(orders: int) -> tuple[str, ...]:
    """Effects of the first powers, 1 to 3, of the temperature of the thirty coefficients."""
    return tuple(f"{base}_{power}" for power in POWERS[:orders] for base in load_model("baseline").effects)


def drawn_polynomials(imu: ImuSpecification, orders: int, rng: np.random.Generator) -> tuple[str, ...]:
    """Draw every coefficient of every polynomial: normal, of the size that the catalogue states for the IMU's grade."""
    effects = [registry.get(name) for name in polynomials(orders)]
    return tuple(
        sized(p.name, float(e.prior[imu.grade] * rng.standard_normal()), size_unit(p.name))
        for e in effects
        for p in e.parameters
    )


def soak(degc: float, lag_s: float = 0.0) -> TemperatureProfile:
    """Make a chamber that stands at a temperature (deg C)."""
    return TemperatureProfile(degc, reference_degc=T0_DEGC, sensor_lag_s=lag_s, noise=_NOISE_K, resolution=_STEP_K)


def ramp(start_degc: float, end_degc: float, rate_k_s: float = _RAMP_K_S, lag_s: float = 0.0) -> TemperatureProfile:
    """Make a chamber that goes from one temperature (deg C) to another, held before and after."""
    until = _HOLD_S + abs(end_degc - start_degc) / rate_k_s
    return replace(soak(start_degc, lag_s), knots=((0.0, start_degc), (_HOLD_S, start_degc), (until, end_degc)))


def stretched(plan: Plan, profile: TemperatureProfile) -> Plan:
    """Make the stops of a plan longer, all by one factor, so that it lasts as long as a ramp and what is held after."""
    whole = profile.knots[-1][0] + _HOLD_S
    stops = sum(plan.dwell_s)
    factor = max(1.0, (whole - (plan.duration_s - stops)) / stops)
    return replace(plan, dwell_s=tuple(factor * dwell for dwell in plan.dwell_s))


@dataclass(frozen=True)
class SoakWorld:
    """Draws of one set."""

    unit: Unit
    site: Site
    plan: Plan
    """Of the soaks."""
    effects: tuple[str, ...]
    """Of the unit: polynomials with sizes."""
    turn_on: dict[str, float]
    """Scatter of the biases (SI)."""
    soaks_degc: tuple[float, ...] = SOAKS_DEGC
    rate_k_s: float = _RAMP_K_S
    """Of the ramps."""
    lag_s: float = 0.0
    """Of the sensors behind the thermometer."""
    noise: tuple[str, ...] = ()
    """Noise with a memory."""

    def scenarios(self) -> list[Scenario]:
        """Five soaks, a ramp up, and a ramp down in the power-on of the ramp up."""
        soaks = [self._of(k, self.plan, soak(degc, self.lag_s)) for k, degc in enumerate(self.soaks_degc, start=1)]
        ends = min(self.soaks_degc), max(self.soaks_degc)
        up, down = (ramp(*way, self.rate_k_s, self.lag_s) for way in (ends, ends[::-1]))
        first = self._of(len(soaks) + 1, stretched(self.plan, up), up)
        again = self._of(len(soaks) + 2, stretched(self.plan, down), down)
        return [*soaks, first, replace(again, coefficients=first.coefficients)]

    def _of(self, number: int, plan: Plan, profile: TemperatureProfile) -> Scenario:
        more = {"noise": self.noise, "temperature": profile}
        return self.unit.scenario(number, plan, self.site, self.turn_on, self.effects, **more)


def in_the_frame(scenario: Scenario) -> tuple[Floats, Floats]:
    """Give true rates and forces of a recording, in the frame of the accelerometers at the temperature of each sample.

    Parameters
    ----------
    scenario : Scenario
        With a temperature.

    Returns
    -------
    omega, force : ndarray, shape (n, 3)
        rad/s, m/s^2: those of an IMU without errors, resolved in the frame that turns with the temperature. The rate
        is that of this frame.
    """
    sensor, profile = imu_truth(scenario), scenario.temperature
    if profile is None:
        raise DataError("the scenario has no temperature")
    perfect = simulate(scenario, ImuTruth(mount_rad=sensor.mount_rad))
    t = perfect.t - 0.5 * perfect.interval_s
    frames = accelerometer_frames(sensor.coefficients, parse_effects(sensor.effects).sizes, _GRID_K)
    middle = len(_GRID_K) // 2
    turns = np.array([rotation_vector(R @ frames[middle].T) for R in frames])
    # The frame follows the thermometer: what the axes lag behind it is an error of the sensors.
    above = profile.value(t) - profile.origin_degc
    theta = np.column_stack([np.interp(above, _GRID_K, turns[:, k]) for k in range(3)])
    slope = np.column_stack([np.interp(above, _GRID_K, np.gradient(turns[:, k], _GRID_K)) for k in range(3)])
    omega, force = (_turned(theta, values @ frames[middle].T) for values in (perfect.omega_ib_b, perfect.f_ib_b))
    # v' = exp([theta x]) v of vectors at rest: the frame itself turns the other way.
    return omega - slope * profile.rate(t)[:, None], force


def _turned(theta: Floats, values: Floats) -> Floats:
    """``exp([theta x]) v``, rows (n, 3), angles of arcminutes: to second order, right to 1e-10 of v."""
    once = np.cross(theta, values)
    return np.asarray(values + once + 0.5 * np.cross(theta, once))


def noise_of(scenario: Scenario, recording: Recording) -> tuple[Floats, Floats]:
    """Noise of the rates and forces of a recording, (n, 3) each (rad/s, m/s^2): less the same sensor without it."""
    quiet = replace(imu_truth(scenario), gyro_white_noise=0.0, accel_white_noise=0.0, noise=())
    clean = simulate(scenario, quiet)
    return recording.omega_ib_b - clean.omega_ib_b, recording.f_ib_b - clean.f_ib_b


def block_rms(values: Floats, interval_s: float) -> float:
    """RMS of means over `BLOCK_S` of rows (n, 3)."""
    size = round(BLOCK_S / interval_s)
    blocks = values[: len(values) // size * size].reshape(-1, size, 3).mean(axis=1)
    return float(np.sqrt(np.mean(blocks**2)))
