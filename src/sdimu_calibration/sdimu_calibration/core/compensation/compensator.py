"""Compensation of samples for the sensor errors.

A sensor measures ``m = x + E(x)``, x = (body rate, specific force) in the body frame of the coefficients, with an
error E that is linear in the coefficients and, for most effects, in x. Solved for x by

    x <- x + inv(A) (m - x - E(x)),    A = I + dE/dx at x = 0,

which is exact after one step where E is affine in x (bias, scale, misalignment, mass unbalance), however large E is;
elsewhere each step multiplies the error by the size of the remainder of E.

Covariance to first order: ``inv(A) (D P D' + N^2/dt) inv(A)'`` with the regressors D at x, the covariance P of the
coefficients and the white noise N of the IMU. The first part is common to all samples, not independent from one to the
next; a ROS message has no field for that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.compensation.reads import reads, samples_motion
from sdimu_calibration.core.effect_key import parse_key
from sdimu_calibration.core.effects import bias, imu_model, selection
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.effects.imu_model import ImuModel
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.navigation.track import temperatures
from sdimu_calibration.core.recording import DataError, Recording, TemperatureLog
from sdimu_calibration.core.results import START_TEMPERATURE, Calibration
from sdimu_calibration.core.specification import ImuSpecification
from sdimu_calibration.core.wording import Option

_ABSENT = {
    "alpha": "needs the angular acceleration",
    "w_table": "needs the rate against the Earth, which only the table test knows",
    "rest": "needs to know when the table rests",
    "C_nb": "needs the attitude",
    "magnetic_n": "needs the magnetic field",
    "turned": "needs the history of turns",
    "leant": "needs the history of forces",
    "since_turn": "needs the history of turns",
    "wound": "needs the history of turns",
    "past": "needs the history of forces",
}
_MARGIN_K = 5.0
"""Distance from the temperatures of the calibration (K) up to which its coefficients are taken to hold: a tenth of the
range in which an IMU is used."""
_CLOSE = 1e-13
"""Largest step at convergence, a share of 1 rad/s or 1 m/s^2 plus the value: a few hundred units of rounding."""
_ROWS = 4096
"""Number of samples whose covariances are worked out at once: they stay in the cache of the processor."""
_MOST_STEPS = 80
"""Largest number of steps: converges to rounding where each step leaves at most 0.68 of the error."""


@dataclass(frozen=True)
class Compensator:
    """A result made ready for samples."""

    model: ImuModel
    """Of the effects that can be compensated in samples."""
    coefficients: Floats
    covariance: Floats
    """`coefficients`, `covariance`: SI, in `body_frame`, shape (p,) and (p, p)."""
    inverse: Floats
    """Shape (6, 6). ``inv(A)`` of the module's equation; rates first."""
    noise: Floats
    """White-noise power of each channel (SI^2/Hz), shape (6,)."""
    residue: Floats
    """Shape (6,). Variance that quantisation adds to the integral of a sample (SI^2 s^2): twice the square of the
    residue."""
    body_frame: str
    left_out: tuple[str, ...]
    """Effects that are not compensated, each with its reason."""
    start_temperature: float | None = None
    """Temperature from which the coefficients count (deg C); None where none of them depends on it."""
    temperature_range: tuple[float, float] | None = None
    """Lowest and highest temperature of the calibration (deg C); None where nothing depends on it, or nobody said."""

    def beyond(self, degc: Floats) -> str:
        """Say that temperatures are far from those of the calibration, where polynomials are a guess; else nothing.

        Parameters
        ----------
        degc : ndarray, shape (n,)
            deg C.
        """
        if self.temperature_range is None or not len(degc):
            return ""
        (low, high), coldest, warmest = self.temperature_range, float(np.min(degc)), float(np.max(degc))
        if coldest >= low - _MARGIN_K and warmest <= high + _MARGIN_K:
            return ""
        return (
            f"temperatures of {coldest:.1f} to {warmest:.1f} degC; the calibration knows {low:.1f} to {high:.1f} degC, "
            "and its temperature coefficients are a guess beyond"
        )


@dataclass(frozen=True)
class Compensated:
    """Compensated samples, in the body frame of the coefficients."""

    omega_ib_b: Floats
    f_ib_b: Floats
    """`omega_ib_b`, `f_ib_b`: rad/s, m/s^2, shape (n, 3)."""
    omega_covariance: Floats
    f_covariance: Floats
    """`omega_covariance`, `f_covariance`: shape (n, 3, 3). Of one sample: coefficients and white noise."""


def resolved(calibration: Calibration, own: Sequence[Effect] = ()) -> tuple[Effect, ...]:
    """Effects of a result, in its order. `own`: effects that are in no catalogue, such as those read from files."""
    given = {effect.key: effect for effect in own}
    try:
        effects = imu_model.told_apart(
            [given[key] if key in given else selection.resolve(key) for key in calibration.model]
        )
    except DataError as error:
        files = "".join(f"; it was read from {file}" for file in calibration.origin.effect_files)
        told = f"the result has an effect of no catalogue: {error}; name its file ({Option.EFFECT}){files}"
        raise DataError(told) from error
    names = tuple(parameter.name for effect in effects for parameter in effect.parameters)
    if names != calibration.names:
        odd = sorted(set(names) ^ set(calibration.names)) or ["their order"]
        raise DataError(f"the coefficients of the result are not those of its effects ({', '.join(odd[:3])})")
    return effects


def compensator(
    calibration: Calibration,
    imu: ImuSpecification,
    *,
    own: Sequence[Effect] = (),
    has_temperature: bool = False,
    same_start: bool = False,
    start_temperature: float | None = None,
) -> Compensator:
    """Make a result ready for samples.

    Parameters
    ----------
    imu : ImuSpecification
        Its white noise goes into the covariances.
    own : sequence of Effect
        Effects of the result that are in no catalogue.
    has_temperature : bool
        The temperature of the IMU is recorded with the samples.
    same_start : bool
        The samples count time from the same event as the calibrated recording (power-on): functions of time hold.
    start_temperature : float, optional
        Temperature from which the coefficients count (deg C), where the result does not state it: that at the start of
        the calibrated recording.
    """
    effects = resolved(calibration, own)
    start = start_temperature if start_temperature is not None else calibration.data.get(START_TEMPERATURE)
    left: list[str] = []
    taken: list[Effect] = []
    kept: list[int] = []
    place = 0
    for effect, key in zip(effects, calibration.model, strict=True):
        reason = _reason(effect, key, has_temperature, start is not None, same_start)
        if reason:
            left.append(f"{key} ({reason})")
        else:
            taken.append(effect)
            kept += range(place, place + len(effect.parameters))
        place += len(effect.parameters)
    if not taken:
        raise DataError(f"nothing of this result can be compensated: {'; '.join(left)}")
    values = np.array(calibration.values[kept], dtype=float)
    covariance = np.array(calibration.covariance[np.ix_(kept, kept)], dtype=float)
    model = imu_model.build(taken, imu)
    T = _origin(model, calibration.drift_means)
    with np.errstate(over="ignore", invalid="ignore"):
        values, covariance = T @ values, T @ covariance @ T.T
    if not (np.isfinite(values).all() and np.isfinite(covariance).all()):
        raise DataError("the result has a coefficient or covariance that is not a number")
    power: Floats = np.repeat(np.array([imu.gyro_white_noise**2, imu.accel_white_noise**2]), 3)
    residue: Floats = 2.0 * np.repeat(np.array([imu.gyro_quantisation**2, imu.accel_quantisation**2]), 3)
    inverse: Floats = np.asarray(np.linalg.inv(slope_at_nought(model, values)), dtype=np.float64)
    warm = any("temperature" in reads(effect) for effect in taken)
    known = (calibration.origin.temperature_low_degc, calibration.origin.temperature_high_degc)
    return Compensator(
        model,
        values,
        covariance,
        inverse,
        power,
        residue,
        calibration.body_frame,
        tuple(left),
        start if warm else None,
        known if warm and np.isfinite(known).all() else None,
    )


def _origin(model: ImuModel, drift_means: Mapping[str, float]) -> Floats:
    """Map from biases in the mean over the calibration to those of the equations, shape (p, p).

    Where a drift is not taken out of the samples, its mean stays with the bias.
    """
    T = np.eye(len(model.names))
    for channel, place in zip(model.channel.tolist(), model.parameter.tolist(), strict=True):
        name = model.names[place]
        if name in drift_means and bias.NAMES[channel] in model.names:
            T[model.names.index(bias.NAMES[channel]), place] = -drift_means[name]
    return T


def _reason(effect: Effect, key: str, has_temperature: bool, start_known: bool, same_start: bool) -> str:
    """Say why samples cannot be freed of an effect; empty when they can."""
    if effect.scope == "recording":
        return "a fault of the recording in which it was found"
    if effect.options and not parse_key(key).options:
        return f"the result does not say its {' and '.join(effect.options)}"
    needed = reads(effect)
    for name, reason in _ABSENT.items():
        if name in needed:
            return reason
    if needed & {"temperature", "temperature_rate"} and not has_temperature:
        return "needs the temperature of the IMU"
    if "temperature" in needed and not start_known:
        return "needs the temperature at the start of the calibrated recording, which the result does not say"
    if "t" in needed and not same_start:
        return f"a function of time in the calibrated recording; {Option.SAME_START} where this recording is that one"
    return ""


def slope_at_nought(model: ImuModel, coefficients: Floats) -> Floats:
    """Return ``I + dE/dx`` at x = 0, rates first, shape (6, 6), by central differences: exact where E is affine.

    Parameters
    ----------
    coefficients : ndarray, shape (p,)
        SI.
    """
    steps = np.diag([1.0, 1.0, 1.0, 10.0, 10.0, 10.0])
    ahead, behind = (_error(model, coefficients, sign * steps) for sign in (1.0, -1.0))
    slope = (ahead - behind).T / (2.0 * np.diag(steps))
    return np.asarray(np.eye(6) + slope)


def _error(model: ImuModel, coefficients: Floats, x: Floats) -> Floats:
    """Errors at x (n, 6), at the start and its temperature."""
    zero = np.zeros(len(x))
    return model.errors(model.regressors(samples_motion(zero, zero, x[:, :3], x[:, 3:], zero, zero)), coefficients)


def heat_since(log: TemperatureLog | None, t: Floats, start_degc: float | None, causal: bool) -> tuple[Floats, Floats]:
    """Temperature difference (K) and its rate (K/s), computed as in the calibration, shape (n,) each.

    Parameters
    ----------
    log : TemperatureLog or None
        None gives zeros.
    t : ndarray, shape (n,)
        s.
    start_degc : float or None
        Temperature from which the difference counts (deg C); None for the origin of the log.
    causal : bool
        Use only what was measured up to t.
    """
    about = log if log is None or start_degc is None else replace(log, reference_degc=start_degc)
    return temperatures(about, t, causal)


def compensate(
    using: Compensator,
    t: Floats,
    interval_s: float,
    omega_ib_b: Floats,
    f_ib_b: Floats,
    heat: tuple[Floats, Floats] | None = None,
) -> Compensated:
    """Compensate samples.

    Parameters
    ----------
    t : ndarray, shape (n,)
        End of each sample's interval (s since the start of the recording).
    omega_ib_b, f_ib_b : ndarray, shape (n, 3)
        As measured (rad/s, m/s^2).
    heat : (ndarray, ndarray), shape (n,) each, optional
        `heat_since` at the middle of each sample.
    """
    n = len(t)
    zero = np.zeros(n)
    dt = np.full(n, interval_s)
    warm, warming = heat if heat is not None else (zero, zero)
    measured = np.hstack([omega_ib_b, f_ib_b])
    x = measured @ using.inverse.T

    def seen() -> Motion:
        return samples_motion(t, dt, x[:, :3], x[:, 3:], warm, warming)

    scaled = np.zeros((n, 6))
    for _ in range(_MOST_STEPS):
        # Divergence ends in the DataError below.
        with np.errstate(over="ignore", invalid="ignore"):
            values = using.model.regressors(seen())
            step = (measured - x - using.model.errors(values, using.coefficients)) @ using.inverse.T
            x = x + step
            scaled = np.nan_to_num(np.abs(step) / (1.0 + np.abs(x)), nan=np.inf)
        if not n or float(scaled.max()) < _CLOSE:
            break
    else:
        worst = int(np.argmax(scaled.max(axis=1)))
        raise DataError(
            f"the error model cannot be inverted at {t[worst]:.3f} s (its errors change faster than what is measured); "
            "check the result, or calibrate with fewer effects"
        )
    omega_covariance, f_covariance = _covariances(using, values, interval_s)
    return Compensated(x[:, :3], x[:, 3:], omega_covariance, f_covariance)


def compensate_recording(using: Compensator, recording: Recording) -> Compensated:
    """Take the errors out of all samples of a recording."""
    t, interval = recording.t, recording.interval_s
    heat = heat_since(recording.temperature, t - 0.5 * interval, using.start_temperature, causal=False)
    return compensate(using, t, interval, recording.omega_ib_b, recording.f_ib_b, heat)


def _covariances(using: Compensator, values: Floats, interval_s: float) -> tuple[Floats, Floats]:
    """Covariances (n, 3, 3) of rate and force from regressor columns (n, m)."""
    model, n = using.model, len(values)
    P = using.covariance[np.ix_(model.parameter, model.parameter)]
    weight = using.inverse[:, model.channel]
    white = using.inverse @ np.diag(using.noise / interval_s + using.residue / interval_s**2) @ using.inverse.T
    out = np.empty((n, 6, 3))
    for first in range(0, n, _ROWS):
        rows = slice(first, first + _ROWS)
        for block in (range(3), range(3, 6)):
            own = [values[rows] * weight[i] for i in block]
            spread = [X @ P for X in own]
            for i in range(3):
                for j in range(i + 1):
                    both = np.einsum("nk,nk->n", spread[i], own[j]) + white[block[i], block[j]]
                    out[rows, block[i], j] = out[rows, block[j], i] = both
    return out[:, :3], out[:, 3:]
