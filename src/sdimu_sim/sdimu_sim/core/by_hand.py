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
_MOST_RESTS = 10_000
"""Number of attitudes at most: a day and a half by hand."""


@dataclass(frozen=True)
class ByHand:
    """A handheld run.

    Attributes
    ----------
    rests : int
        Random attitudes, uniform over all.
    imu, site : ImuSpecification, Site
        The site makes the truth; no estimator knows it.
    seed : int
        Of everything random: attitudes, times, sway, coefficients, noise.
    rate_hz : float
        Of the IMU.
    rest_s, turn_s : tuple of float
        Shortest and longest rest and turn.
    lever_arm_m : tuple of float
        Accelerometers from the wrist, in b: their force in a turn is not gravity's alone.
    effects : tuple of str
        Hidden effects, canonical keys with sizes.
    noise : tuple of str
        Noise with a memory, as of `Scenario`.
    nudges : float
        Share of the rests in which somebody nudges the IMU: it wobbles for a moment and comes back.
    """

    rests: int
    imu: ImuSpecification
    site: Site
    seed: int = 1
    rate_hz: float = 100.0
    rest_s: tuple[float, float] = (1.5, 5.0)
    turn_s: tuple[float, float] = (0.8, 2.5)
    lever_arm_m: tuple[float, float, float] = (0.12, -0.05, 0.2)
    effects: tuple[str, ...] = ()
    noise: tuple[str, ...] = ()
    nudges: float = 0.0

    def with_effects(self, *effects: str) -> ByHand:
        """Return the same run by a hand that holds an IMU with these hidden effects."""
        return replace(self, effects=effects)


def simulate_by_hand(run: ByHand) -> tuple[ImuSamples, Truth]:
    """Simulate a run."""
    if not 2 <= run.rests <= _MOST_RESTS:
        raise DataError(f"{run.rests} attitudes by hand: expected 2 to {_MOST_RESTS}")
    if not 10.0 <= run.rate_hz <= 1000.0:
        raise DataError(f"sample rate {run.rate_hz:g} Hz: expected 10 to 1000 Hz")
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
    t0 = 0.0
    times: list[Floats] = []
    turned: list[Floats] = []
    rates: list[Floats] = []
    for k in range(run.rests):
        rest = _grid(rng.uniform(*run.rest_s))
        nudged = run.nudges > 0.0 and rng.random() < run.nudges
        # A rest needs its two ends only: between equal attitudes at rate zero the motion stands still.
        for part in (0.5 * rest, 0.5 * rest) if nudged else (rest,):
            times.append(np.array([t0, t0 + _grid(part)]))
            turned.append(np.repeat(attitudes[k][None], 2, axis=0))
            rates.append(np.zeros((2, 3)))
            t0 = times[-1][1]
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


def _sway(tau: Floats, length: float, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Rotation vector of sway and tremor and its derivative (rad, rad/s), (n, 3) each, zero at both ends."""
    t = tau * length
    fade, fading = np.sin(np.pi * tau) ** 2, np.pi / length * np.sin(2.0 * np.pi * tau)
    value, rate = np.zeros((len(t), 3)), np.zeros((len(t), 3))
    for band, size in ((_SWAY_HZ, _SWAY_RAD), (_TREMOR_HZ, _TREMOR_RAD)):
        omega = 2.0 * np.pi * rng.uniform(*band, 3)
        phase, amplitude = rng.uniform(0.0, 2.0 * np.pi, 3), size * rng.uniform(0.3, 1.0, 3)
        angle = t[:, None] * omega + phase
        value += amplitude * np.sin(angle)
        rate += amplitude * omega * np.cos(angle)
    return fade[:, None] * value, fading[:, None] * value + fade[:, None] * rate


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
