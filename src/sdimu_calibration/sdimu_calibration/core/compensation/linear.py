"""The affine part of a result, as matrices and biases: ``m = A x + b``, A and b polynomials of the temperature."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import comb
from typing import NamedTuple

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.compensation.compensator import resolved
from sdimu_calibration.core.compensation.reads import reads, samples_motion
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import START_TEMPERATURE, Calibration

_AFFINE = 1e-10
"""Deviation from a straight line, a share of the size of the regressor: above rounding, below any nonlinearity."""


class Factor(NamedTuple):
    """What a part of a model is multiplied by: ``(T - T0)^power (dT/dt)^rate_power``, in K and K/s."""

    power: int
    rate_power: int


_CONSTANT = Factor(0, 0)
_FACTORS = (_CONSTANT, Factor(1, 0), Factor(2, 0), Factor(3, 0), Factor(0, 1), Factor(1, 1), Factor(2, 1))
"""Factors that a form of export may have a place for."""


@dataclass(frozen=True)
class Part:
    """Part of the sensors that is multiplied by one factor; rates first."""

    matrix: Floats
    """Shape (6, 6)."""
    bias: Floats
    """rad/s, m/s^2, per unit of the factor, shape (6,)."""

    @property
    def gyro(self) -> Floats:
        """Gyros to the body rate, shape (3, 3)."""
        return self.matrix[:3, :3]

    @property
    def accel(self) -> Floats:
        """Accelerometers to the specific force, shape (3, 3)."""
        return self.matrix[3:, 3:]

    @property
    def by_force(self) -> Floats:
        """Gyros to the specific force ((rad/s)/(m/s^2)), shape (3, 3)."""
        return self.matrix[:3, 3:]

    @property
    def gyro_bias(self) -> Floats:
        """Biases of the gyros (rad/s), shape (3,)."""
        return self.bias[:3]

    @property
    def accel_bias(self) -> Floats:
        """Biases of the accelerometers (m/s^2), shape (3,)."""
        return self.bias[3:]


@dataclass(frozen=True)
class LinearModel(Part):
    """Sensors as matrices.

    ``rate measured = gyro w + by_force f + gyro_bias``, ``force measured = accel f + accel_bias``, with the body rate w
    and the specific force f in `body_frame`. `gyro` and `accel` are ``I + scale + misalignment``, `by_force` mass
    unbalance and g-sensitivity. All this at T0; each of `parts` adds to it, times its factor.
    """

    body_frame: str
    left: tuple[str, ...]
    """Coefficients of effects that are not affine."""
    parts: Mapping[Factor, Part]
    """What follows the temperature and its rate; empty where nothing does."""
    of_temperature: tuple[str, ...]
    """Effects that are in `parts`."""
    temperature_degc: float | None
    """T0 (deg C); None where the result does not say it."""

    def at(self, degc: float) -> LinearModel:
        """State the same sensors from another temperature: ``(x + step)^n`` in powers of x.

        `degc`: the new T0 (deg C).
        """
        if not self.parts:
            return self
        if self.temperature_degc is None:
            raise DataError(
                f"temperature {degc:g} degC: the result does not say from which temperature its coefficients count "
                f"(data.{START_TEMPERATURE})"
            )
        step = degc - self.temperature_degc
        sums: dict[Factor, Part] = {_CONSTANT: self}
        for (power, rate_power), part in self.parts.items():
            for lower in range(power + 1):
                share = comb(power, lower) * step ** (power - lower)
                _add(sums, Factor(lower, rate_power), share * part.matrix, share * part.bias)
        here = sums.pop(_CONSTANT)
        return replace(self, matrix=here.matrix, bias=here.bias, parts=_ascending(sums), temperature_degc=degc)


def _add(sums: dict[Factor, Part], factor: Factor, matrix: Floats, bias: Floats) -> None:
    before = sums.get(factor)
    sums[factor] = Part(matrix, bias) if before is None else Part(before.matrix + matrix, before.bias + bias)


def _ascending(sums: Mapping[Factor, Part]) -> dict[Factor, Part]:
    return {factor: sums[factor] for factor in _FACTORS if factor in sums}


def linear_model(calibration: Calibration, own: Sequence[Effect] = ()) -> LinearModel:
    """Collect every coefficient whose effect is affine in rate and force, at each temperature.

    `own`: effects of the result that are in no catalogue.
    """
    sums = {_CONSTANT: Part(np.eye(6), np.zeros(6))}
    left: list[str] = []
    warm: list[str] = []
    place = 0
    for effect in resolved(calibration, own):
        own_values = calibration.values[place : place + len(effect.parameters)]
        place += len(effect.parameters)
        constant, slope, kind = _shape(effect)
        for column, term in enumerate(effect.terms):
            if kind[column] < 0:
                left.append(effect.parameters[term.parameter].name)
                continue
            matrix, bias = np.zeros((6, 6)), np.zeros(6)
            matrix[term.channel] = own_values[term.parameter] * slope[column]
            bias[term.channel] = own_values[term.parameter] * constant[column]
            _add(sums, _FACTORS[kind[column]], matrix, bias)
        warm += [effect.key] if (kind > 0).any() else []
    if any(np.any(part.matrix[3:, :3]) for part in sums.values()):
        # No form in use lets an accelerometer see the rate.
        left.append("sensitivity of the accelerometers to rate")
    at_start = sums.pop(_CONSTANT)
    return LinearModel(
        at_start.matrix,
        at_start.bias,
        calibration.body_frame,
        tuple(dict.fromkeys(left)),
        _ascending(sums),
        tuple(warm),
        calibration.data.get(START_TEMPERATURE),
    )


def _shape(effect: Effect) -> tuple[Floats, Floats, Ints]:
    """Regressor columns as ``factor (constant + slope x)``.

    Returns
    -------
    constant, slope : ndarray, shapes (m,) and (m, 6)
    kind : ndarray of int, shape (m,)
        Place of each column's factor in `_FACTORS`; -1 where it is not of this shape.
    """
    m = len(effect.terms)
    if effect.scope == "recording" or reads(effect) - {"w", "f", "temperature", "temperature_rate"}:
        return np.zeros(m), np.zeros((m, 6)), np.full(m, -1)
    scale = np.array([1.0, 1.0, 1.0, 10.0, 10.0, 10.0])
    points = np.vstack([np.zeros(6), np.diag(scale), np.random.default_rng(5).normal(size=(40, 6)) * scale])
    values = _values(effect, points, 1.0, 1.0)
    constant = values[0]
    slope = (values[1:7] - constant).T / scale
    largest = np.maximum(np.abs(values).max(axis=0), 1e-300)
    straight = np.abs(values - constant - points @ slope.T).max(axis=0) <= _AFFINE * largest
    kind = np.full(m, -1)
    for place, factor in enumerate(_FACTORS):
        follows = straight.copy()
        for heat, rate in ((-2.0, 3.0), (0.5, -2.0), (20.0, 0.1)):
            expected = heat**factor.power * rate**factor.rate_power * values
            off = np.abs(_values(effect, points, heat, rate) - expected).max(axis=0)
            follows &= off <= _AFFINE * np.maximum(np.abs(expected).max(axis=0), largest)
        kind[follows & (kind < 0)] = place
    return constant, slope, kind


def _values(effect: Effect, points: Floats, heat: float, rate: float) -> Floats:
    """Regressors at points (n, 6) of rate and force, at a temperature above T0 (K) and its rate (K/s)."""
    zero = np.zeros(len(points))
    return effect.regressors(samples_motion(zero, zero, points[:, :3], points[:, 3:], zero + heat, zero + rate))
