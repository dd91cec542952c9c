"""The simulated IMU: motion of the platform in, samples out, all at once or block by block."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.rotation import rotation_matrix
from sdimu_calibration.core.specification import Site
from sdimu_calibration.core.units import STANDARD_GRAVITY
from sdimu_sim.core.coloured import ColouredNoise
from sdimu_sim.core.equation import CONSTANTS
from sdimu_sim.core.hidden import DIRECTIONS, LOST_AFTER_S, parse_effects
from sdimu_sim.core.memory import memory
from sdimu_sim.core.platform import PlatformMotion, mean_motion
from sdimu_sim.core.samples import STILL_RAD_S, SampleClock, TrueSamples, Variables, in_body, rotated
from sdimu_sim.core.temperature import TemperatureProfile
from sdimu_sim.core.truth import ImuTruth, biases, child_rng, input_axes, unbalance_matrix


def response(truth: ImuTruth, true: TrueSamples) -> Floats:
    """Make the readings of the six sensors, shape (6, m), with the thirty coefficients and nothing else.

    ``input axis . true vector + bias``, and for gyros the mass unbalance times f/g.
    """
    gyro, accel = input_axes("gyro", truth.coefficients), input_axes("accel", truth.coefficients)
    unbalance = unbalance_matrix(truth.coefficients) / STANDARD_GRAVITY
    out = np.concatenate([_times(gyro, true.omega_ib), _times(accel, true.f_ib)])
    out[:3] += _times(unbalance, true.f_ib)
    bias = np.concatenate([biases("gyro", truth.coefficients), biases("accel", truth.coefficients)])
    result: Floats = out + bias[:, None]
    return result


def _times(M: Floats, v: Floats) -> Floats:
    # Term by term: a matrix product's digits would depend on the number of columns.
    return np.array([M[i, 0] * v[0] + M[i, 1] * v[1] + M[i, 2] * v[2] for i in range(3)])


class Electronics:
    """White noise, saturation and quantisation: what has a memory or a random stream of its own."""

    def __init__(self, truth: ImuTruth, interval_s: float, seed: int) -> None:
        self._interval = interval_s
        # A density is the sigma of a mean over 1 s; over dt it is larger by 1/sqrt(dt).
        self._sigma = (truth.gyro_white_noise / interval_s**0.5, truth.accel_white_noise / interval_s**0.5)
        self._rng = (child_rng(seed, "gyro_white_noise"), child_rng(seed, "accel_white_noise"))
        self._limit = (truth.gyro_limit_rad_s, truth.accel_limit_m_s2)
        self._step = (truth.gyro_step_rad, truth.accel_step_m_s)
        self._remainder = np.zeros((2, 3))

    def apply(self, readings: Floats) -> tuple[Floats, Floats]:
        """Finish a block of readings (6, m): body rate and specific force, shape (m, 3) each."""
        gyro, accel = (self._triad(k, np.ascontiguousarray(readings[3 * k : 3 * k + 3].T)) for k in (0, 1))
        return gyro, accel

    def _triad(self, k: int, values: Floats) -> Floats:
        if self._sigma[k]:
            values = values + self._sigma[k] * self._rng[k].standard_normal(values.shape)
        if np.isfinite(self._limit[k]):
            values = np.clip(values, -self._limit[k], self._limit[k])
        if self._step[k]:
            values = _count_pulses(values, self._step[k] / self._interval, self._remainder[k])
        return values


@compiled
def _count_pulses(values: Floats, step: float, remainder: Floats) -> Floats:
    """Whole pulses per sample; what is left over stays in the integrator (`remainder` (3,), in place)."""
    out = np.empty_like(values)
    for k in range(values.shape[0]):
        for i in range(3):
            total = values[k, i] + remainder[i]
            out[k, i] = step * np.round(total / step)
            remainder[i] = total - out[k, i]
    return out


_BLOCK = 20_000
"""Motion samples worked on at once: bounds the memory of long tests at high rates."""


@dataclass(frozen=True)
class ImuSamples:
    """Readings of the IMU."""

    ns: Ints
    """Shape (m,). Stamps: ends of the sample intervals (ns from the start)."""
    t: Floats
    """The same in s, shape (m,)."""
    omega_ib_b: Floats
    f_ib_b: Floats
    """`omega_ib_b`, `f_ib_b`: rad/s, m/s^2, as measured, shape (m, 3)."""


class ImuGenerator:
    """Makes samples as motion comes in; the same digits however the motion is cut into blocks."""

    def __init__(
        self, truth: ImuTruth, site: Site, rate_hz: float, seed: int, temperature: TemperatureProfile | None = None
    ) -> None:
        self._truth, self._hidden = truth, parse_effects(truth.effects)
        if self._hidden.needs_temperature and temperature is None:
            raise DataError("a hidden effect needs the temperature: give a temperature profile")
        self._clock = SampleClock(rate_hz)
        self._coloured = ColouredNoise(truth.noise, self._clock.interval_s, seed)
        self._electronics = Electronics(truth, self._clock.interval_s, seed)
        self._variables = Variables(temperature)
        self._memories = {
            number: memory(term.memory[0], term.parameters[term.memory[2]], self._clock.interval_s)
            for number, term in enumerate(self._hidden.terms)
            if term.memory
        }
        off = self._hidden.site
        self._gravity = gravity_of(site) - off.gravity
        self._omega_ie_n = earth.earth_rate(site.latitude_rad - off.latitude)
        self._field_n = np.asarray(truth.magnetic_field, dtype=np.float64)
        self._C_tb = rotation_matrix(np.asarray(truth.mount_rad, dtype=np.float64))
        self._motion = PlatformMotion(np.empty(0), np.empty((0, 4)), np.empty((0, 3)))
        self._turn_starts: list[float] = []
        self._emitted = 0

    def advance(self, block: PlatformMotion) -> ImuSamples:
        """Take the next motion samples and return the IMU samples that end within them."""
        self._append(block)
        first, last = self._emitted + 1, self._emitted
        if len(self._motion.t) > 1:
            last = self._clock.count(float(self._motion.t[-1]))
        if last < first:
            empty = np.empty((0, 3))
            return ImuSamples(np.empty(0, dtype=np.int64), np.empty(0), empty, empty.copy())
        edges = self._clock.seconds(first - 1, last)
        gyro, accel = self._electronics.apply(self._readings(edges))
        self._emitted = last
        self._forget(float(edges[-1]))
        ns = self._clock.nanoseconds(first, last)
        return ImuSamples(ns, ns / 1e9, gyro, accel)

    def _append(self, block: PlatformMotion) -> None:
        old = self._motion
        t = np.concatenate([old.t, block.t])
        if len(block.t) and np.any(np.diff(t[max(len(old.t) - 1, 0) :]) <= 0.0):
            raise DataError("motion of the platform: times do not ascend")
        omega = np.concatenate([old.omega_nt_t, block.omega_nt_t])
        self._motion = PlatformMotion(t, np.concatenate([old.q_nt, block.q_nt]), omega)
        new = max(len(old.t) - 1, 0)
        still = ~np.any(omega[new:], axis=1)
        self._turn_starts.extend(t[new:-1][still[:-1] & ~still[1:]].tolist())

    def _forget(self, reached_s: float) -> None:
        """Drop motion that no later sample needs, delayed ones included."""
        needed = reached_s - max(self._hidden.delay_s)
        keep = max(int(np.searchsorted(self._motion.t, needed - 1e-9, side="right")) - 2, 0)
        m = self._motion
        self._motion = PlatformMotion(m.t[keep:], m.q_nt[keep:], m.omega_nt_t[keep:])

    def _true(self, edges: Floats) -> TrueSamples:
        m = self._motion
        means = mean_motion(m.t, m.q_nt, m.omega_nt_t, edges, self._omega_ie_n, self._field_n)
        true = in_body(means, self._C_tb, self._gravity, np.asarray(self._truth.lever_arm_m))
        east = self._hidden.site.east
        if not east:
            return true
        # The plumb line hangs West of the Down that the test believes in: f turns with it.
        tilt = np.sin(east) * self._direction(edges, 1) + (1.0 - np.cos(east)) * true.down
        return replace(true, f_ib=true.f_ib + self._gravity * tilt)

    def _direction(self, edges: Floats, axis: int) -> Floats:
        """Mean North (0) or East (1) component of each body axis, shape (3, m): seen as a field of size one."""
        m = self._motion
        means = mean_motion(m.t, m.q_nt, m.omega_nt_t, edges, self._omega_ie_n, np.eye(3)[axis])
        return rotated(self._C_tb, means[12:15])

    def _readings(self, edges: Floats) -> Floats:
        """Make the readings of the six sensors (6, m), without white noise."""
        delays = self._hidden.delay_s
        true = self._true(edges)
        out = response(self._truth, true)
        for delay in sorted(set(delays) - {0.0}):
            late = [k for k in range(6) if delays[k] == delay]
            out[late] = response(self._truth, self._true(edges - delay))[late]
        if self._hidden.terms:
            values = CONSTANTS | self._variables.of(true, 0.5 * (edges[:-1] + edges[1:]))
            if self._hidden.reads & DIRECTIONS:
                pairs = (("n", self._direction(edges, 0)), ("e", self._direction(edges, 1)))
                values |= {f"{name}{axis}": v[i] for name, v in pairs for i, axis in enumerate("xyz")}
            for number, term in enumerate(self._hidden.terms):
                own: dict[str, Floats | float] = {**term.parameters}
                if term.memory:
                    own["y"] = self._memories[number](np.asarray(values[term.memory[1]]))
                out[term.sensor] += term.expression.evaluate({**values, **own})
        self._coloured.add(out, np.abs(true.omega_nb).max(axis=0) > STILL_RAD_S)
        self._lose(out, true, edges)
        if not np.isfinite(out).all():
            raise DataError("a hidden effect gives numbers that are not finite: check its formula")
        return out

    def _lose(self, out: Floats, true: TrueSamples, edges: Floats) -> None:
        """Take away the gyros' increments over the lost stretch of a turn."""
        for turn, length, at in self._hidden.lost:
            if turn <= len(self._turn_starts):
                begin = self._turn_starts[turn - 1] + LOST_AFTER_S if at is None else at - 0.5 * length
                overlap = np.minimum(edges[1:], begin + length) - np.maximum(edges[:-1], begin)
                out[:3] -= true.omega_ib * (np.maximum(overlap, 0.0) / self._clock.interval_s)


def gravity_of(site: Site) -> float:
    """Gravity at a site (m/s^2): the measured one, else WGS-84 normal gravity."""
    if site.gravity_m_s2 is not None:
        return site.gravity_m_s2
    return float(earth.normal_gravity(site.latitude_rad, site.height_m))


def simulate_imu(
    motion: PlatformMotion,
    truth: ImuTruth,
    site: Site,
    rate_hz: float,
    seed: int,
    temperature: TemperatureProfile | None = None,
) -> ImuSamples:
    """Make all samples of a test.

    `motion`: from t = 0; before that the platform rests. `rate_hz`: sample k = 1, 2, ... ends at k / rate.
    """
    generator = ImuGenerator(truth, site, rate_hz, seed, temperature)
    parts = [
        generator.advance(
            PlatformMotion(motion.t[k : k + _BLOCK], motion.q_nt[k : k + _BLOCK], motion.omega_nt_t[k : k + _BLOCK])
        )
        for k in range(0, len(motion.t), _BLOCK)
    ]
    return ImuSamples(
        np.concatenate([p.ns for p in parts]),
        np.concatenate([p.t for p in parts]),
        np.concatenate([p.omega_ib_b for p in parts]),
        np.concatenate([p.f_ib_b for p in parts]),
    )
