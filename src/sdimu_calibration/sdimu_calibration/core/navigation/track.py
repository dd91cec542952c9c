"""From cycles to motion: attitude by integrating the gyros, then what the effects see."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.effects.imu_model import ImuModel
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.matrix3 import elements, multiplied, orthonormal3, rotation3, store
from sdimu_calibration.core.navigation.strapdown import Cycles
from sdimu_calibration.core.recording import TemperatureLog

_COMPENSATIONS = 3
"""Number of rounds of compensation: each leaves an error smaller by a factor of the size of the sensor errors."""
MAGNETIC_FIELD = np.array([30.0e-6, -4.5e-6, 40.0e-6])
"""Magnetic field in NED (T) where the site gives none: size and dip of mid-northern latitudes."""
_STANDING = np.radians(0.01)
"""Rate below which the table stands (rad/s): above the bias of a gyro that is worth a rate table."""
_TURNING = np.radians(0.5)
"""Body rate that counts as a turn (rad/s), and change of the force per g that counts as leaning (1/s): above biases."""
_TEMPERATURE_WINDOW_S = 60.0
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
    cycles : Cycles
    latitude : float
        rad.

    Returns
    -------
    ndarray, shape (n, 3, 3)
        `C_nb` at the middle of each cycle.
    """
    return np.asarray(_attitudes(C_nb, np.ascontiguousarray(cycles.alpha), cycles.coning, cycles.dt, latitude))


def temperatures(log: TemperatureLog | None, t: Floats, causal: bool) -> tuple[Floats, Floats]:
    """Temperature since the start (K) and its rate (K/s) at times `t`.

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
    half = 0.5 * _TEMPERATURE_WINDOW_S
    if causal:
        index = np.maximum(np.searchsorted(log.t, t + 1e-9, side="right") - 1, 0)
        before = np.maximum(np.searchsorted(log.t, t - 2.0 * half, side="right") - 1, 0)
        span = np.maximum(log.t[index] - log.t[before], half)
        return log.value[index] - log.value[0], (log.value[index] - log.value[before]) / span
    low, high = np.maximum(t - half, log.t[0]), np.minimum(t + half, log.t[-1])
    rise = np.interp(high, log.t, log.value) - np.interp(low, log.t, log.value)
    return np.interp(t, log.t, log.value) - log.value[0], rise / np.maximum(high - low, 1e-3)


def motion(
    cycles: Cycles,
    rest: Bools,
    model: ImuModel,
    coefficients: Floats,
    C_start: Floats,
    latitude: float,
    gravity: float,
    temperature: TemperatureLog | None,
    predicted: bool,
    before: Motion | None = None,
    magnetic_n: Floats = MAGNETIC_FIELD,
) -> Motion:
    """Motion of each cycle, as the effects see it.

    Parameters
    ----------
    cycles : Cycles
    rest : ndarray of bool, shape (n,)
        Cycles in dwell.
    model, coefficients : ImuModel and ndarray, shape (p,)
        Sensor errors taken out of the samples.
    C_start : ndarray, shape (3, 3)
        Attitude at the start; moved to the end of the cycles, in place.
    latitude, gravity : float
        Of the site (rad, m/s^2).
    temperature : TemperatureLog or None
    predicted : bool
        Put the rate and force that the attitude predicts in place of the measured ones at rest, so that regressors
        such as sign(w) carry no noise there. Needs a good `C_start` and coefficients.
    before : Motion, optional
        Motion of the block before this one, where blocks follow each other.
    magnetic_n : ndarray, shape (3,)
        Magnetic field in NED (T).

    Returns
    -------
    Motion
    """
    dt = cycles.dt
    w_measured, f_measured = cycles.alpha / dt[:, None], cycles.upsilon / dt[:, None]
    heat, heat_rate = temperatures(temperature, cycles.t - 0.5 * dt, causal=not predicted)
    w, f = w_measured, f_measured
    C0 = C_start.copy()
    rounds = _COMPENSATIONS if np.any(coefficients) else 0
    for done in range(rounds + 1):
        C = C0.copy()
        C_nb = _attitudes(C, np.ascontiguousarray(w * dt[:, None]), cycles.coning, dt, latitude)
        w_earth = np.einsum("kij,i->kj", C_nb, earth.earth_rate(latitude))
        w_table = np.where(rest[:, None], 0.0, w - w_earth)
        if predicted:
            w_seen = w_earth + w_table
            f_seen = np.where(rest[:, None], -gravity * C_nb[:, 2, :], f)
        else:
            w_seen, f_seen = w, f
        alpha = _acceleration(w_table, rest, cycles, before, causal=not predicted)
        turned = _last_sign(w_table, None if before is None else before.turned[-1])
        leant = _last_sign(-np.cross(w_table, f_seen) / gravity, None if before is None else before.leant[-1])
        since_turn = _since_turn(w_table, cycles.t, dt, before)
        seen = Motion(
            cycles.t, dt, w_seen, f_seen, C_nb, w_table, alpha, rest, heat, heat_rate, turned, leant,
            since_turn, magnetic_n,
        )  # fmt: skip
        if done < rounds:
            error = model.errors(model.regressors(seen), coefficients)
            w, f = w_measured - error[:, :3], f_measured - error[:, 3:]
    C_start[:, :] = C
    return seen


def _acceleration(
    w_table: Floats, rest: Bools, cycles: Cycles, before: Motion | None, causal: bool
) -> Floats:
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


def _last_sign(rate: Floats, before: Floats | None) -> Floats:
    """Sign of the last rate beyond `_TURNING` in each column, carried forward; shape (n, 3)."""
    sign = np.where(np.abs(rate) > _TURNING, np.sign(rate), 0.0)
    rows = np.where(sign != 0.0, np.arange(1, len(sign) + 1)[:, None], 0)
    last = np.maximum.accumulate(rows, axis=0)
    start = np.zeros(3) if before is None else before
    return np.where(last > 0, np.take_along_axis(sign, np.maximum(last - 1, 0), axis=0), start)


def _since_turn(w_table: Floats, t: Floats, dt: Floats, before: Motion | None) -> Floats:
    """Time from the end of the last cycle in which the table turned to the middle of each cycle, shape (n,)."""
    turning = np.sum(w_table**2, axis=1) > _STANDING**2
    start = -np.inf if before is None else float(before.t[-1] - 0.5 * before.dt[-1] - before.since_turn[-1])
    end = np.maximum.accumulate(np.where(turning, t, start))
    return np.where(turning, 0.0, t - 0.5 * dt - end)
