"""From cycles to motion: attitude by integrating the gyros, then what the effects see."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.effects.imu_model import ImuModel, errors_along
from sdimu_calibration.core.effects.motion import NO_PAST, Motion
from sdimu_calibration.core.matrix3 import elements, multiplied, orthonormal3, rotation3, store
from sdimu_calibration.core.navigation.strapdown import Cycles
from sdimu_calibration.core.recording import TemperatureLog

_COMPENSATIONS = 3
"""Number of rounds of compensation at most: each leaves an error smaller by the size of the sensor errors."""
_SAME = np.array([1e-13] * 3 + [1e-11] * 3)
"""Change of the sensor errors (rad/s, m/s^2) that is none: a millionth of what the best biases are known to."""
MAGNETIC_FIELD = np.array([30.0e-6, -4.5e-6, 40.0e-6])
"""Magnetic field in NED (T) where the site gives none: size and dip of mid-northern latitudes."""
_STANDING = np.radians(0.01)
"""Rate below which the table stands (rad/s): above the bias of a gyro that is worth a rate table."""
_TURNING = np.radians(0.5)
"""Body rate that counts as a turn (rad/s), and change of the force per g that counts as leaning (1/s): above biases."""
TEMPERATURE_WINDOW_S = 60.0
"""Time over which the temperature rate is a mean (s): a shorter one differentiates the resolution of the sensor."""


@compiled
def _attitudes(C_nb: Floats, alpha: Floats, coning: Floats, dt: Floats, latitude: float) -> Floats:
    """Attitude at the middle of each cycle, (n, 3, 3); `C_nb` is moved to the end, in place."""
    out = np.empty((dt.shape[0], 3, 3))
    w_ie = earth.earth_rate(latitude)
    C = elements(C_nb)
    for k in range(dt.shape[0]):
        h = -0.5 * dt[k]
        turn = rotation3(h * w_ie[0], h * w_ie[1], h * w_ie[2])
        half = rotation3(
            0.5 * (alpha[k, 0] + coning[k, 0]), 0.5 * (alpha[k, 1] + coning[k, 1]), 0.5 * (alpha[k, 2] + coning[k, 2])
        )
        middle = multiplied(multiplied(turn, C), half)
        store(middle, out[k])
        C = orthonormal3(multiplied(multiplied(turn, middle), half))
    store(C, C_nb)
    return out


def integrate(C_nb: Floats, cycles: Cycles, latitude: float) -> Floats:
    """Integrate the gyros to the attitude at the middle of each cycle.

    Parameters
    ----------
    C_nb : ndarray, shape (3, 3)
        Attitude at the start; moved to the end of the cycles, in place.
    latitude : float
        rad.

    Returns
    -------
    ndarray, shape (n, 3, 3)
        `C_nb` at the middle of each cycle.
    """
    return np.asarray(_attitudes(C_nb, cycles.alpha, cycles.coning, cycles.dt, latitude))


def temperatures(log: TemperatureLog | None, t: Floats, causal: bool) -> tuple[Floats, Floats]:
    """Temperature above the origin of the log (K) and its rate (K/s) at times `t`.

    Parameters
    ----------
    log : TemperatureLog or None
        None gives zeros.
    t : ndarray, shape (n,)
        s.
    causal : bool
        Use only what was measured up to t, as a live filter must.

    Returns
    -------
    temperature, rate : ndarray, shape (n,)
    """
    if log is None or not len(log.t):
        return np.zeros(len(t)), np.zeros(len(t))
    half = 0.5 * TEMPERATURE_WINDOW_S
    if causal:
        index = np.maximum(np.searchsorted(log.t, t + 1e-9, side="right") - 1, 0)
        before = np.maximum(np.searchsorted(log.t, t - 2.0 * half, side="right") - 1, 0)
        span = np.maximum(log.t[index] - log.t[before], half)
        return log.value[index] - log.origin_degc, (log.value[index] - log.value[before]) / span
    low, high = np.maximum(t - half, log.t[0]), np.minimum(t + half, log.t[-1])
    rise = np.interp(high, log.t, log.value) - np.interp(low, log.t, log.value)
    return np.interp(t, log.t, log.value) - log.origin_degc, rise / np.maximum(high - low, 1e-3)


@dataclass(frozen=True)
class Surroundings:
    """What is about the IMU during a test."""

    latitude: float
    """Of the site (rad)."""
    gravity: float
    """At the site (m/s^2)."""
    temperature: TemperatureLog | None = None
    """None: nobody measured it."""
    magnetic_n: Floats = field(default_factory=MAGNETIC_FIELD.copy)
    """Magnetic field in NED (T), shape (3,)."""


@dataclass(frozen=True)
class Correction:
    """Sensor errors that are taken out of samples."""

    model: ImuModel
    coefficients: Floats
    """Of the model (SI), shape (p,)."""
    rounds: int = _COMPENSATIONS
    """At most; what they leave is the size of the sensor errors to this power, plus one, of the rate."""


def motion(
    cycles: Cycles,
    rest: Bools,
    correction: Correction,
    C_start: Floats,
    around: Surroundings,
    predicted: bool,
    before: Motion | None = None,
    causal: bool = False,
) -> Motion:
    """Motion of each cycle, as the effects see it.

    Parameters
    ----------
    rest : ndarray of bool, shape (n,)
        Cycles in dwell.
    correction : Correction
        Sensor errors taken out of the samples.
    C_start : ndarray, shape (3, 3)
        Attitude at the start; moved to the end of the cycles, in place.
    around : Surroundings
        Site, temperature and magnetic field.
    predicted : bool
        Put the rate and force that the attitude predicts in place of the measured ones at rest, so that regressors
        such as sign(w) carry no noise there. Needs a good `C_start` and coefficients.
    before : Motion, optional
        Motion of the block before this one, where blocks follow each other.
    causal : bool
        Take the rate of the temperature and the angular acceleration from what came before, as a filter must that
        runs while the samples arrive. Both are then late, by 30 s and by half a cycle; whoever has the whole
        recording takes them about the cycle.
    """
    dt = cycles.dt
    w_measured, f_measured = cycles.alpha / dt[:, None], cycles.upsilon / dt[:, None]
    heat, heat_rate = temperatures(around.temperature, cycles.t - 0.5 * dt, causal)
    C0 = C_start.copy()
    sized = correction.model.sized(correction.coefficients)
    rounds = correction.rounds if sized else 0
    error = np.zeros((len(dt), 6))
    earlier = _AtStart.of(before)
    past = NO_PAST if before is None else before.left
    w_ie = earth.earth_rate(around.latitude)
    for done in range(rounds + 1):
        C = C0.copy()
        w, f = w_measured - error[:, :3], f_measured - error[:, 3:]
        C_nb = _attitudes(C, w * dt[:, None], cycles.coning, dt, around.latitude)
        w_seen, f_seen, w_table, turned, leant, since_turn, wound = _seen(
            C_nb, w, f, rest, cycles.t, dt, w_ie, around.gravity, predicted, earlier
        )
        alpha = _acceleration(w_table, rest, cycles, before, causal)
        seen = Motion(
            cycles.t,
            dt,
            w_seen,
            f_seen,
            C_nb,
            w_table,
            alpha,
            rest,
            heat,
            heat_rate,
            turned,
            leant,
            since_turn,
            around.magnetic_n,
            wound,
            past,
        )
        if done == rounds:
            break
        taken, error = error, errors_along(sized, seen)
        if (np.abs(error - taken) <= _SAME).all():
            break
    C_start[:, :] = C
    return seen


class _AtStart(NamedTuple):
    """What the motion before the first cycle leaves behind."""

    turned: Floats  # (3,)
    leant: Floats  # (3,)
    turn_end: float  # s
    wound: Floats  # (3,), rad

    @staticmethod
    def of(before: Motion | None) -> _AtStart:
        """Nothing has turned yet where there is no block before."""
        if before is None:
            return _AtStart(np.zeros(3), np.zeros(3), -np.inf, np.zeros(3))
        end = float(before.t[-1] - 0.5 * before.dt[-1] - before.since_turn[-1])
        # The middle of the last cycle has been reached: the rest of that cycle is still to come.
        wound = before.wound[-1] + 0.5 * before.dt[-1] * before.w_table[-1]
        return _AtStart(before.turned[-1].copy(), before.leant[-1].copy(), end, wound)


@compiled
def _seen(
    C_nb: Floats,
    w: Floats,
    f: Floats,
    rest: Bools,
    t: Floats,
    dt: Floats,
    w_ie: Floats,
    gravity: float,
    predicted: bool,
    before: _AtStart,
) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats, Floats]:
    """Rate and force that effects see, the rate against the Earth, and what of past turns they remember.

    Returns
    -------
    w_seen, f_seen, w_table, turned, leant : ndarray, shape (n, 3)
    since_turn : ndarray, shape (n,)
    wound : ndarray, shape (n, 3)
        All as in `Motion`.
    """
    n = len(t)
    w_seen, f_seen, w_table = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3))
    turned, leant, since_turn = np.empty((n, 3)), np.empty((n, 3)), np.empty(n)
    wound, angle = np.empty((n, 3)), before.wound.copy()
    last_turned, last_leant, end = before.turned.copy(), before.leant.copy(), before.turn_end
    for k in range(n):
        square = 0.0
        for i in range(3):
            w_earth = C_nb[k, 0, i] * w_ie[0] + C_nb[k, 1, i] * w_ie[1] + C_nb[k, 2, i] * w_ie[2]
            w_table[k, i] = 0.0 if rest[k] else w[k, i] - w_earth
            w_seen[k, i] = w_earth + w_table[k, i] if predicted else w[k, i]
            f_seen[k, i] = -gravity * C_nb[k, 2, i] if predicted and rest[k] else f[k, i]
            square += w_table[k, i] ** 2
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            leaning = (w_table[k, b] * f_seen[k, a] - w_table[k, a] * f_seen[k, b]) / gravity
            if abs(w_table[k, i]) > _TURNING:
                last_turned[i] = np.sign(w_table[k, i])
            if abs(leaning) > _TURNING:
                last_leant[i] = np.sign(leaning)
            turned[k, i], leant[k, i] = last_turned[i], last_leant[i]
            wound[k, i] = angle[i] + 0.5 * dt[k] * w_table[k, i]
            angle[i] += dt[k] * w_table[k, i]
        if square > _STANDING**2:
            end, since_turn[k] = t[k], 0.0
        else:
            since_turn[k] = t[k] - 0.5 * dt[k] - end
    return w_seen, f_seen, w_table, turned, leant, since_turn, wound


def _acceleration(w_table: Floats, rest: Bools, cycles: Cycles, before: Motion | None, causal: bool) -> Floats:
    """Angular acceleration (rad/s^2), shape (n, 3): mean over each cycle, or by causal differences for a live filter.

    The mean is the difference of the rates at the ends of the cycle, so that it sums up to the change of the rate.
    Between rest and turn the rate is zero: angular acceleration within a dwell would count as a rate there.
    """
    dt = cycles.dt[:, None]
    if causal or len(w_table) < 2:
        earlier = np.vstack([before.w_table[-1:] if before is not None else w_table[:1], w_table[:-1]])
        return np.asarray((w_table - earlier) / dt)
    between = (dt[1:] * w_table[:-1] + dt[:-1] * w_table[1:]) / (dt[1:] + dt[:-1])
    between[rest[1:] | rest[:-1]] = 0.0
    ends = np.vstack([w_table[:1], between, w_table[-1:]])
    return np.asarray(np.diff(ends, axis=0) / dt)
