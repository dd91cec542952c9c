"""A whole simulated test: plan, table, IMU and site in; recording and truth out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from rate_table_sim.core import TableMotion, TableSpecification, phase_changes, table_motion
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.recording import DataError, PhaseLog, Recording, TableLog, TemperatureLog
from sdimu_calibration.core.specification import ImuSpecification, Site
from sdimu_sim.core.generator import ImuSamples, simulate_imu
from sdimu_sim.core.hidden import canonical, parse_effects
from sdimu_sim.core.mean_bias import mean_bias
from sdimu_sim.core.platform import PlatformMotion
from sdimu_sim.core.samples import SampleClock
from sdimu_sim.core.temperature import TemperatureProfile, Thermometer
from sdimu_sim.core.truth import DEFAULT_MAGNETIC_FIELD, ImuTruth, Truth, draw_coefficients, draw_mount, turned_on

DEFAULT_START_NS = 1_700_000_000 * 10**9
TABLE_LOG_HZ = 10.0


@dataclass(frozen=True)
class Scenario:
    """What is simulated."""

    plan: Plan
    imu: ImuSpecification
    site: Site
    table: TableSpecification = field(default_factory=TableSpecification)
    rate_hz: float = 100.0
    """Of the IMU, 10 to 1000."""
    seed: int = 1
    """Of everything random: coefficients, mount, noise, encoders."""
    mount_rad: tuple[float, float, float] | None = None
    """Rotation vector of the IMU on the platform; None draws it up to `mount_max_rad` about every axis."""
    mount_max_rad: float = float(np.radians(3.0))
    effects: tuple[str, ...] = ()
    """Hidden effects, canonical keys with sizes."""
    noise: tuple[str, ...] = ()
    """Noise with a memory, keys with sizes (`sdimu_sim.core.coloured`)."""
    temperature: TemperatureProfile | None = None
    coefficients: Mapping[str, float] | None = None
    """As built, SI; None draws them from the IMU's specification."""
    unit: int | None = None
    """Seed of the coefficients in place of `seed`: scenarios of one unit have the same."""
    turn_on: Mapping[str, float] = field(default_factory=dict)
    """By group of coefficients, such as ``gyro_bias``, the sigma (SI) by which each of them differs in this power-on.
    """
    extras: Mapping[str, object] = field(default_factory=dict)
    """Other attributes of `ImuTruth` (lever arm, quantisation ...)."""
    start_ns: int = DEFAULT_START_NS

    @property
    def reference_degc(self) -> float | None:
        """Temperature T0 for which the coefficients are stated (deg C); None without a temperature."""
        return None if self.temperature is None else self.temperature.origin_degc


def imu_truth(scenario: Scenario) -> ImuTruth:
    """Draw or take over the true sensor of a scenario."""
    mount = scenario.mount_rad
    truth = ImuTruth(
        coefficients=_coefficients(scenario),
        mount_rad=draw_mount(scenario.mount_max_rad, scenario.seed) if mount is None else mount,
        gyro_white_noise=scenario.imu.gyro_white_noise,
        accel_white_noise=scenario.imu.accel_white_noise,
        effects=tuple(scenario.effects),
        noise=tuple(scenario.noise),
        magnetic_field=scenario.site.magnetic_field_t or DEFAULT_MAGNETIC_FIELD,
    )
    return with_hidden(replace(truth, **scenario.extras))  # type: ignore[arg-type]


def _coefficients(scenario: Scenario) -> dict[str, float]:
    """Coefficients in this power-on: those of the unit, and what it was switched on with."""
    seed = scenario.seed if scenario.unit is None else scenario.unit
    of_unit = draw_coefficients(scenario.imu, seed) if scenario.coefficients is None else dict(scenario.coefficients)
    return turned_on(of_unit, scenario.turn_on, scenario.seed)


def with_hidden(truth: ImuTruth) -> ImuTruth:
    """Take coefficients and lever arm that its effects name into a truth, and write the effects canonically."""
    hidden = parse_effects(truth.effects)
    lever_arm = [hidden.lever_arm_m.get(i, value) for i, value in enumerate(truth.lever_arm_m)]
    return replace(
        truth,
        coefficients={**truth.coefficients, **hidden.coefficients},
        lever_arm_m=(lever_arm[0], lever_arm[1], lever_arm[2]),
        effects=tuple(map(canonical, truth.effects)),
    )


@dataclass(frozen=True)
class SimulatedTest:
    """Everything that came of a scenario: motion of the table, samples of the IMU, and the truth."""

    motion: TableMotion
    samples: ImuSamples
    truth: Truth


def simulate_test(scenario: Scenario) -> SimulatedTest:
    """Simulate a test, with the table's motion kept."""
    if not 10.0 <= scenario.rate_hz <= 1000.0:
        raise DataError(f"sample rate {scenario.rate_hz:g} Hz: expected 10 to 1000 Hz")
    if scenario.seed < 0:
        raise DataError(f"seed {scenario.seed}: expected a whole number from 0")
    imu = imu_truth(scenario)
    motion = table_motion(scenario.plan, scenario.table, scenario.seed)
    platform = PlatformMotion(motion.t, motion.q_nt, motion.omega_nt_t)
    samples = simulate_imu(platform, imu, scenario.site, scenario.rate_hz, scenario.seed, scenario.temperature)
    interval = SampleClock(scenario.rate_hz).interval_s
    mean = mean_bias(imu, samples.t, PhaseLog(*phase_changes(motion)), interval, scenario.seed)
    truth = Truth(
        imu, scenario.site, scenario.seed, scenario.rate_hz, scenario.plan.name, mean, scenario.reference_degc
    )
    return SimulatedTest(motion, samples, truth)


def generate(scenario: Scenario) -> tuple[Recording, Truth]:
    """Simulate a test into the recording that the topics would give, and its truth."""
    test = simulate_test(scenario)
    t, dwell, stop = phase_changes(test.motion)
    recording = Recording(
        start_ns=scenario.start_ns,
        t=test.samples.t,
        omega_ib_b=test.samples.omega_ib_b,
        f_ib_b=test.samples.f_ib_b,
        phase=PhaseLog(t, dwell, stop),
        temperature=temperature_log(scenario, float(test.motion.t[-1])),
        table=_table_log(test.motion),
    )
    return recording, test.truth


def temperature_log(scenario: Scenario, until_s: float) -> TemperatureLog | None:
    """Read the thermometer at 1 Hz, from 0 to a time (s); its reference is the one that the profile states, if any."""
    if scenario.temperature is None:
        return None
    t = np.arange(int(until_s + 1e-9) + 1, dtype=np.float64)
    profile = scenario.temperature
    return TemperatureLog(t, Thermometer(profile, scenario.seed).read(t), profile.reference_degc)


def table_log_rows(motion: TableMotion) -> slice:
    """Rows of the motion that are logged as joint states: about `TABLE_LOG_HZ`."""
    interval = float(motion.t[1] - motion.t[0]) if len(motion.t) > 1 else 1.0
    return slice(None, None, max(round(1.0 / (interval * TABLE_LOG_HZ)), 1))


def _table_log(motion: TableMotion) -> TableLog:
    rows = table_log_rows(motion)
    return TableLog(motion.t[rows], motion.names, motion.encoder_angle[rows])
