"""Coefficients of the baseline as polynomials of the temperature, and their hysteresis between heating and cooling.

Every coefficient c of the baseline becomes ``c + k1 (T - T0) + k2 (T - T0)^2 + k3 (T - T0)^3``: one effect a power,
so that a model takes as many as the data show. The first powers of most are in `temperature`. IEEE Std 1293 and 952
state temperature coefficients as such polynomials.

One recording rarely spans the temperatures that tell the powers apart. They are tried where several recordings are
diagnosed together, and can be added to any model.

Coefficients of the rate of the temperature are linear in it, too: sensors whose thermometer runs ahead show what
follows ``d(T - T0)^2/dt``. So do gyros whose axes turn in the second power (`body_frame`), with a square in the third.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects import registry, temperature  # noqa: F401  (the first powers)
from sdimu_calibration.core.effects.bias import ACCEL_BIAS, GYRO_BIAS
from sdimu_calibration.core.effects.effect import Effect, Excitation, Parameter
from sdimu_calibration.core.effects.mass_unbalance import GYRO_MASS_UNBALANCE
from sdimu_calibration.core.effects.misalignment import ACCEL_MISALIGNMENT, GYRO_MISALIGNMENT
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.effects.registry import register
from sdimu_calibration.core.effects.scale import ACCEL_SCALE, GYRO_SCALE
from sdimu_calibration.core.units import from_si, to_si

_BASES = (GYRO_BIAS, GYRO_SCALE, GYRO_MISALIGNMENT, GYRO_MASS_UNBALANCE, ACCEL_BIAS, ACCEL_SCALE, ACCEL_MISALIGNMENT)
_OF_ONE_SENSOR = (GYRO_BIAS, GYRO_SCALE, ACCEL_BIAS, ACCEL_SCALE)
"""Baseline effects whose heating and cooling differ: what the material of one sensor does. Angles and masses follow the
expansion of metal, which comes back."""
_POWERS = {1: "", 2: "_squared", 3: "_cubed"}
_WORDS = {1: "temperature coefficient", 2: "quadratic temperature coefficient", 3: "cubic temperature coefficient"}
_ANGLE = {grade: to_si(size, "arcsec/degC") for grade, size in (("navigation", 1.0), ("tactical", 5.0), ("mems", 20.0))}
"""Linear temperature coefficient of an angle (rad/K): a block of metal warmed unevenly turns by 0.1-1 arcsec/K, an
instrument on screws by some, a package soldered to a board by ten and more."""
_RANGE_K = 50.0
"""Distance from T0 at which an IMU is used (K): -40 to 70 degC about room temperature."""
_BEND = 0.5
"""Share of each power in the one below it, at `_RANGE_K` (1): curves of data sheets bend and do not turn over."""
_LOOP = 0.05
"""Width of the loop of heating and cooling, a share of the linear change over `_RANGE_K` (1): data sheets of quartz and
silicon accelerometers and of fibre-optic gyros state 1 to 10 %."""
_LAG_S = 120.0
"""Lag of a sensor behind its thermometer (s): a case of a kilogram warms its instruments in minutes."""
_THRESHOLD = to_si(0.2, "degC/min")
"""Rate at which heating is told from cooling (K/s): above what a resolution of 0.06 degC gives over a minute, below
the slowest ramp of a chamber."""


def _linear_prior(base: Effect) -> dict[str, float]:
    """Return one sigma of the linear temperature coefficient by grade (SI)."""
    linear = registry.find(f"{base.name}_temperature")
    return _ANGLE if linear is None else dict(linear.prior)


def _power(base: Effect, order: int) -> Effect:
    """Temperature coefficient of one order of a baseline effect."""
    power = "" if order == 1 else f"^{order}"
    smaller = (_BEND / _RANGE_K) ** (order - 1)
    return _multiplied(
        base,
        f"_temperature{_POWERS[order]}",
        lambda motion: motion.temperature**order,
        units=(f"/K{power}", f"/degC{power}"),
        prior={grade: smaller * size for grade, size in _linear_prior(base).items()},
        title=f"{base.title}: {_WORDS[order]}",
        equation=f"{base.equation}, each coefficient k (T - T0){power}",
        typical=_TYPICAL[order],
        description=_DESCRIPTIONS[order],
        confused_with=tuple(f"{base.name}_temperature{_POWERS[lower]}" for lower in range(1, order)),
    )


_TYPICAL = {
    1: "machined block 0.05-1, screwed instruments 1-5, printed board 5-30 arcsec/C",
    2: f"a tenth to a half of what the linear coefficient makes {_RANGE_K:g} degC from T0",
    3: f"less than a quarter of what the linear coefficient makes {_RANGE_K:g} degC from T0",
}
_DESCRIPTIONS = {
    1: "Expansion turns the input axes. A turn of all axes together is a matter of definition, as it is without "
    "temperature: the body frame is that of the accelerometers at every temperature (doc/temperature.md).",
    2: "The linear coefficient changes with temperature. Needs temperatures far from T0.",
    3: "Bends the curve at both ends of the range. Needs four temperatures or more over the range.",
}


def _hysteresis(base: Effect, threshold: float = _THRESHOLD) -> Effect:
    """Difference between heating and cooling, smooth below `threshold` (K/s)."""
    return _multiplied(
        base,
        "_temperature_hysteresis",
        lambda motion: np.tanh(motion.temperature_rate / threshold),
        units=("", ""),
        prior={grade: _LOOP * _RANGE_K * size for grade, size in _linear_prior(base).items()},
        title=f"{base.title}: hysteresis between heating and cooling",
        equation=f"{base.equation}, each coefficient k tanh((dT/dt) / threshold)",
        typical=f"1-10 % of what the linear coefficient makes over {_RANGE_K:g} degC",
        description="Another value on the way up than on the way down, however fast: friction between materials. k is "
        "half the width of the loop; nothing at constant temperature. Needs ramps up and down, and two speeds to tell "
        "it from a rate term.",
        confused_with=(f"{base.name}_temperature_rate",),
        options={"threshold": f"{from_si(threshold, 'degC/min'):.6g} degC/min"},
        with_options=lambda threshold: _hysteresis(base, threshold),
    )


def _rate(base: Effect) -> Effect:
    """Coefficient of the rate of the temperature of a baseline effect that has none in `temperature`."""
    return _multiplied(
        base,
        "_temperature_rate",
        lambda motion: motion.temperature_rate,
        units=("*s/K", "*min/degC"),
        prior={grade: _LAG_S * size for grade, size in _linear_prior(base).items()},
        title=f"{base.title}: temperature-rate coefficient",
        equation=f"{base.equation}, each coefficient k dT/dt",
        typical="the temperature coefficient times the lag of the sensor behind its thermometer, some 10 s to minutes",
        description="A sensor that lags behind the thermometer by L shows -L times its temperature coefficient.",
        confused_with=(f"{base.name}_temperature",),
        tried_in="request",
    )


def _rate_power(rate: Effect, order: int, word: str) -> Effect:
    """Rate coefficient that follows a power of the temperature."""
    stem, power = f"{rate.name}_{word}", "" if order == 1 else f"^{order}"
    smaller = (_BEND / _RANGE_K) ** order
    return replace(
        rate,
        name=stem,
        title=f"{rate.title}: {word} in the temperature",
        equation=f"{rate.equation.replace('dT/dt', f'(T - T0){power} dT/dt')}",
        parameters=tuple(
            Parameter(stem + p.name.removeprefix(rate.name), f"{p.unit}^{order + 1}", f"{p.display_unit}^{order + 1}")
            for p in rate.parameters
        ),
        regressors=lambda motion: rate.regressors(motion) * (motion.temperature**order)[:, None],
        prior={grade: smaller * size for grade, size in rate.prior.items()},
        typical="-2 k L of a quadratic temperature coefficient k and a lag L; 2 or 3 times the bend of the axes",
        description="The rate of a square or cube: a sensor that lags behind the thermometer shows it, and so do gyros "
        "whose axes bend with the temperature (doc/temperature.md).",
        confused_with=(rate.name,),
        tried_in="request",
        sheet="",
    )


def _multiplied(
    base: Effect,
    suffix: str,
    factor: Callable[[Motion], Floats],
    units: tuple[str, str],
    tried_in: Literal["set", "request"] = "set",
    **more: Any,
) -> Effect:
    """Make an effect of a baseline effect whose coefficients are `factor`, shape (n,), times new ones."""
    stem = base.name + suffix
    shown = "arcsec" if base.parameters[0].unit == "rad" else base.parameters[0].display_unit
    return Effect(
        name=stem,
        parameters=tuple(
            Parameter(stem + p.name.removeprefix(base.name), p.unit + units[0], shown + units[1])
            for p in base.parameters
        ),
        terms=base.terms,
        regressors=lambda motion: base.regressors(motion) * factor(motion)[:, None],
        needs="temperature",
        excitation=frozenset({Excitation.REPEATED_ATTITUDES}),
        shifts_bias=base.scope == "power-on",
        gauge=base.gauge,
        tried_in=tried_in,
        **more,
    )


for _base in _BASES:
    for _order, _power_word in _POWERS.items():
        if registry.find(f"{_base.name}_temperature{_power_word}") is None:
            register(_power(_base, _order))
for _base in _BASES:
    _own = registry.find(f"{_base.name}_temperature_rate") or register(_rate(_base))
    register(_rate_power(_own, 1, "linear"))
    if _base is GYRO_BIAS:
        register(_rate_power(_own, 2, "quadratic"))
for _base in _OF_ONE_SENSOR:
    register(_hysteresis(_base))
