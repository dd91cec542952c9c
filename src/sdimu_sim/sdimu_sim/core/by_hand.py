"""A test plan of another kind: a hand puts the IMU into random attitudes, one after the other.

Every turn is one smooth turn the shortest way (fifth-degree profile of least jerk; Flash & Hogan, J. Neuroscience 5,
1985) with sway and tremor on it, in any direction and fading at both ends; the IMU is put down between turns and then
lies still. Nothing here is small or linearised: attitude and rate are exact functions of time, sampled.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.recording import DataError, Recording
from sdimu_calibration.core.rotation import quaternion_matrix, rotation_vector
from sdimu_calibration.core.specification import ImuSpecification, Site
from sdimu_calibration.core.units import STANDARD_GRAVITY
from sdimu_sim.core.generator import ImuSamples, simulate_imu
from sdimu_sim.core.platform import PlatformMotion
from sdimu_sim.core.scenario import DEFAULT_START_NS, with_hidden
from sdimu_sim.core.truth import ImuTruth, Truth, child_rng, draw_coefficients, with_longer_axes

_MOTION_HZ = 200.0
"""Samples of the motion: twenty a swing of the tremor."""
_SWAY_HZ, _TREMOR_HZ = (1.0, 3.0), (8.0, 12.0)
"""Bands of arm and of physiological tremor (Elble & Koller, *Tremor*, 1990)."""
_SWAY_RAD, _TREMOR_RAD = np.radians(3.0), np.radians(0.15)
"""Amplitudes: at most 30 and 10 deg/s."""
_NUDGE_S, _NUDGE = 0.4, 0.1
"""Length of a nudge (s), and its amplitudes as a share of those of a turn: tenths of a degree."""
_TREMBLE_FADE_S = 0.15
"""Time in which the tremble of a rest begins and ends (s): a hand trembles to the end, and the motion stays smooth."""
_MOST_RESTS = 10_000
"""Number of attitudes at most: a day and a half by hand."""


@dataclass(frozen=True)
class ByHand:
    """A handheld run."""

    rests: int
    """Random attitudes, uniform over all."""
    imu: ImuSpecification
    site: Site
    """`imu`, `site`: the site makes the truth; no estimator knows it."""
    seed: int = 1
    """Of everything random: attitudes, times, sway, coefficients, noise."""
    rate_hz: float = 100.0
    rest_s: tuple[float, float] = (1.5, 5.0)
    turn_s: tuple[float, float] = (0.8, 2.5)
    """`rest_s`, `turn_s`: shortest and longest rest and turn."""
    lever_arm_m: tuple[float, float, float] = (0.12, -0.05, 0.2)
    """Accelerometers from the wrist, in b: their force in a turn is not gravity's alone."""
    effects: tuple[str, ...] = ()
    """Hidden effects, canonical keys with sizes."""
    noise: tuple[str, ...] = ()
    """Noise with a memory, as of `Scenario`."""
    nudges: float = 0.0
    """Share of the rests in which somebody nudges the IMU: it wobbles for a moment and comes back."""
    trembling: int = 0
    """Number of rests in which the hand holds the IMU and trembles."""
    tremble: tuple[float, float] = (2.0, 6.0)
    """Least and largest scatter (1 sigma) of a trembling rest, as a multiple of that of a quiet one."""

    def with_effects(self, *effects: str) -> ByHand:
        """Return the same run by a hand that holds an IMU with these hidden effects."""
        return replace(self, effects=effects)


def simulate_by_hand(run: ByHand) -> tuple[ImuSamples, Truth]:
    """Simulate a run."""
    if not 2 <= run.rests <= _MOST_RESTS:
        raise DataError(f"{run.rests} attitudes by hand: expected 2 to {_MOST_RESTS}")
    if not 10.0 <= run.rate_hz <= 1000.0:
        raise DataError(f"sample rate {run.rate_hz:g} Hz: expected 10 to 1000 Hz")
    if not 0 <= run.trembling <= run.rests:
        raise DataError(f"{run.trembling} trembling rests: expected 0 to {run.rests}, the number of rests")
    imu = with_hidden(
        ImuTruth(
            coefficients=draw_coefficients(run.imu, run.seed),
            gyro_white_noise=run.imu.gyro_white_noise,
            accel_white_noise=run.imu.accel_white_noise,
            effects=run.effects,
            noise=run.noise,
            lever_arm_m=run.lever_arm_m,
        )
    )
    samples = simulate_imu(by_hand_motion(run), imu, run.site, run.rate_hz, run.seed, None)
    return samples, Truth(imu, run.site, run.seed, run.rate_hz, f"{run.rests} attitudes by hand")


def by_hand_recording(run: ByHand) -> tuple[Recording, Truth]:
    """Simulate a run into a recording: samples and nothing else."""
    samples, truth = simulate_by_hand(run)
    return Recording(DEFAULT_START_NS, samples.t, samples.omega_ib_b, samples.f_ib_b), truth


def against_gravity(truth: Truth, gravity: float, true_gravity: float) -> Truth:
    """State a truth as one would who takes gravity for `gravity` (m/s^2): accelerometer axes longer or shorter."""
    share = true_gravity / gravity
    return replace(truth, imu=replace(truth.imu, coefficients=with_longer_axes(truth.imu.coefficients, share)))


def by_hand_motion(run: ByHand) -> PlatformMotion:
    """Make the motion of the IMU, its own axes against NED."""
    rng = child_rng(run.seed, "by hand")
    attitudes = _random_quaternions(rng, run.rests)
    trembles = child_rng(run.seed, "trembling")
    trembling = set(trembles.permutation(run.rests)[: run.trembling].tolist())
    t0 = 0.0
    times: list[Floats] = []
    turned: list[Floats] = []
    rates: list[Floats] = []
    for k in range(run.rests):
        rest = _grid(rng.uniform(*run.rest_s))
        nudged = run.nudges > 0.0 and rng.random() < run.nudges
        # A rest needs its two ends only: between equal attitudes at rate zero the motion stands still.
        for part in (0.5 * rest, 0.5 * rest) if nudged else (rest,):
            t, q, w = _held(run, attitudes[k], _grid(part), trembles if k in trembling else None)
            times.append(t0 + t)
            turned.append(q)
            rates.append(w)
            t0 = times[-1][-1]
            if nudged:
                nudged = False
                tau = np.arange(1, round(_NUDGE_S * _MOTION_HZ)) / round(_NUDGE_S * _MOTION_HZ)
                q, w = _turn(attitudes[k], attitudes[k], tau, _NUDGE_S, rng, _NUDGE)
                times.append(t0 + tau * _NUDGE_S)
                turned.append(q)
                rates.append(w)
                t0 += _NUDGE_S
        if k + 1 < run.rests:
            length = _grid(rng.uniform(*run.turn_s))
            tau = np.arange(1, round(length * _MOTION_HZ)) / round(length * _MOTION_HZ)
            q, w = _turn(attitudes[k], attitudes[k + 1], tau, length, rng)
            times.append(t0 + tau * length)
            turned.append(q)
            rates.append(w)
            t0 += length
    return PlatformMotion(np.concatenate(times), np.concatenate(turned), np.concatenate(rates))


def _held(
    run: ByHand, attitude: Floats, length: float, rng: np.random.Generator | None
) -> tuple[Floats, Floats, Floats]:
    """Make times (n,) from zero, attitudes (n, 4) and body rates (n, 3) of a rest: still, or trembling with an `rng`.

    The triad in which the tremble shows more scatters as many times its noise as drawn.
    """
    if rng is None:
        return np.array([0.0, length]), np.repeat(attitude[None], 2, axis=0), np.zeros((2, 3))
    tau = np.arange(round(length * _MOTION_HZ) + 1) / round(length * _MOTION_HZ)
    sway, sway_rate = _sway(tau, length, rng, _TREMBLE_FADE_S)
    arm = np.cross(np.gradient(sway_rate, tau * length, axis=0), np.array(run.lever_arm_m))
    down = quaternion_matrix(attitude).T[:, 2] * STANDARD_GRAVITY
    seen = (
        np.sqrt(np.sum(sway_rate**2) / len(tau) / 3.0),
        np.sqrt(np.sum((arm + np.cross(down, sway)) ** 2) / len(tau) / 3.0),
    )
    noise = np.sqrt(run.rate_hz) * np.array([run.imu.gyro_white_noise, run.imu.accel_white_noise])
    share = np.sqrt(rng.uniform(*run.tremble) ** 2 - 1.0) * float(np.min(noise / np.array(seen)))
    q = _product(attitude[None], _exponential(share * sway))
    return tau * length, q, _body_rate(share * sway, share * sway_rate)


def _grid(seconds: float) -> float:
    """Return the nearest whole number of motion samples (s)."""
    return max(round(seconds * _MOTION_HZ), 2) / _MOTION_HZ


def _random_quaternions(rng: np.random.Generator, number: int) -> Floats:
    """Attitudes uniform over all rotations, (n, 4)."""
    q = rng.standard_normal((number, 4))
    return np.asarray(q / np.linalg.norm(q, axis=1)[:, None])


def _turn(
    start: Floats, end: Floats, tau: Floats, length: float, rng: np.random.Generator, sway_share: float = 1.0
) -> tuple[Floats, Floats]:
    """Attitude (n, 4) and body rate (n, 3) of a turn at shares `tau` (n,) of its `length` (s)."""
    way = rotation_vector(quaternion_matrix(start).T @ quaternion_matrix(end))
    share = tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2)
    speed = 30.0 * tau**2 * (1.0 - tau) ** 2 / length
    sway, sway_rate = (sway_share * part for part in _sway(tau, length, rng))
    # q = start * exp(share way) * exp(sway): the rate of the first turn is seen through the second.
    q = _product(_product(start, _exponential(share[:, None] * way)), _exponential(sway))
    return q, _turned_back(speed[:, None] * way, sway) + _body_rate(sway, sway_rate)


def _sway(tau: Floats, length: float, rng: np.random.Generator, fade_s: float | None = None) -> tuple[Floats, Floats]:
    """Rotation vector of sway and tremor and its derivative (rad, rad/s), (n, 3) each, zero at both ends.

    It grows to the middle, or within `fade_s` from both ends.
    """
    t = tau * length
    short = 0.5 * length if fade_s is None else min(fade_s, 0.5 * length)
    near = np.minimum(np.minimum(t, length - t), short)
    side = np.where(near < short, np.where(tau < 0.5, 1.0, -1.0), 0.0)
    rise = 0.5 * np.pi / short
    fade, fading = np.sin(rise * near)[:, None] ** 2, (rise * np.sin(2.0 * rise * near) * side)[:, None]
    value, rate = np.zeros((len(t), 3)), np.zeros((len(t), 3))
    for band, size in ((_SWAY_HZ, _SWAY_RAD), (_TREMOR_HZ, _TREMOR_RAD)):
        omega = 2.0 * np.pi * rng.uniform(*band, 3)
        phase, amplitude = rng.uniform(0.0, 2.0 * np.pi, 3), size * rng.uniform(0.3, 1.0, 3)
        angle = t[:, None] * omega + phase
        value += amplitude * np.sin(angle)
        rate += amplitude * omega * np.cos(angle)
    return fade * value, fading * value + fade * rate


def _product(p: Floats, q: Floats) -> Floats:
    """Quaternion products, scalar first, (4,) or (n, 4)."""
    p, q = np.broadcast_arrays(p, q)
    scalar = p[..., :1] * q[..., :1] - np.sum(p[..., 1:] * q[..., 1:], axis=-1, keepdims=True)
    vector = p[..., :1] * q[..., 1:] + q[..., :1] * p[..., 1:] + np.cross(p[..., 1:], q[..., 1:])
    return np.concatenate([scalar, vector], axis=-1)


def _exponential(phi: Floats) -> Floats:
    """Quaternions of rotation vectors (n, 3)."""
    half = 0.5 * np.linalg.norm(phi, axis=1)[:, None]
    return np.hstack([np.cos(half), 0.5 * np.sinc(half / np.pi) * phi])


def _turned_back(v: Floats, phi: Floats) -> Floats:
    """``exp(phi).T @ v``, row by row."""
    q = _exponential(phi)
    once = np.cross(-q[:, 1:], v)
    return np.asarray(v + 2.0 * (q[:, :1] * once + np.cross(-q[:, 1:], once)))


def _body_rate(phi: Floats, rate: Floats) -> Floats:
    """Body rate of a rotation vector and its derivative (Bortz 1971, inverted): exact."""
    a2 = np.sum(phi**2, axis=1)[:, None]
    a = np.sqrt(np.maximum(a2, 1e-12))
    c1 = np.where(a2 < 1e-8, 0.5, (1.0 - np.cos(a)) / a**2)
    c2 = np.where(a2 < 1e-8, 1.0 / 6.0, (a - np.sin(a)) / a**3)
    once = np.cross(phi, rate)
    return np.asarray(rate - c1 * once + c2 * np.cross(phi, once))
