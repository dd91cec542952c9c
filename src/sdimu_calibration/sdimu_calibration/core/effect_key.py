"""The canonical key of an effect: one spelling for options, files and results.

    accel_quadratic                         all coefficients of a registered effect
    accel_quadratic_x                       one coefficient
    gyro_bias_warm_up_x(tau=300 s)          a variant: what enters nonlinearly stands in brackets
    gyro_x: ey^2                            an equation: the sensor, then the formula whose factor is the coefficient
    my.yaml, my.yaml:k                      an effect file, and one coefficient of it
    gyro_bias_warm_up_x(tau=300 s)=0.3 deg/h     with the size that a simulation gives it
    gyro_x: wx*exp(-t/300.0)=1e-6 rad/s; name=my_k   an equation that is coefficient `my_k` of an effect file

A key knows no physics: the estimator and the simulator read the same keys, each with formulas of its own.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from sdimu_calibration.core.data_error import DataError
from sdimu_calibration.core.units import UnitError, from_si, parse_quantity

SENSORS = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
"""The six sensors, in the order of every array of six."""
_NAME = re.compile(r"([A-Za-z0-9_+]+)\s*(?:\((.*)\))?")
_FILE = re.compile(r"(.+\.ya?ml)(?::([A-Za-z]\w*))?")
_PURE = re.compile(r"[-+\d.eE\s]*")


@dataclass(frozen=True)
class EffectKey:
    """An effect as people name it."""

    name: str
    """Registered effect, coefficient, ``SENSOR: FORMULA``, or path of an effect file (``:COEFFICIENT`` behind it)."""
    options: Mapping[str, str] = field(default_factory=dict)
    """Fixed quantities with their units, such as ``{"tau": "300 s"}``."""
    size: str = ""
    """Quantity with its unit, or empty."""

    def __str__(self) -> str:
        """Write the key in its canonical spelling."""
        size = f"={self.size}" if self.size else ""
        if self.equation:
            # Brackets belong to the formula.
            return self.name + size + "".join(f"; {k}={v}" for k, v in self.options.items())
        return self.name + variant(self.options) + size

    @property
    def equation(self) -> tuple[str, str] | None:
        """Sensor and formula of an equation; None for everything else."""
        sensor, colon, formula = self.name.partition(": ")
        return (sensor, formula) if colon and sensor in SENSORS else None

    @property
    def file(self) -> tuple[str, str] | None:
        """Path of an effect file and the coefficient asked for (or empty); None for everything else."""
        found = _FILE.fullmatch(self.name)
        return (found.group(1), found.group(2) or "") if found else None


def variant(options: Mapping[str, str]) -> str:
    """Write options as they stand behind a name, e.g. ``(tau=1200 s)``; empty without options."""
    return "(" + ", ".join(f"{k}={v}" for k, v in options.items()) + ")" if options else ""


_FROM_ZERO = frozenset({"t0", "at", "turn"})
"""Options that may be zero: a place in the test, and no size."""


def parse_key(text: str) -> EffectKey:
    """Read a key.

    The former spelling of the simulator, ``NAME=VALUE; option=value``, is read too.
    """
    left, size = _split(text)
    size, *older = (part.strip() for part in size.split(";"))
    sensor, colon, formula = (part.strip() for part in left.partition(":"))
    if colon and sensor in SENSORS:
        return EffectKey(f"{sensor}: {formula}", _options(text, older), size)
    if _FILE.fullmatch(left):
        return EffectKey(left, {}, size)
    if colon:
        raise DataError(f"equation '{text}': no such sensor (expected {', '.join(SENSORS)}, then ': FORMULA')")
    form = _NAME.fullmatch(left)
    if not form:
        raise DataError(
            f"cannot read effect '{text}' (expected NAME, NAME(option=value, ...) or 'SENSOR: FORMULA'; "
            "a simulation adds =SIZE)"
        )
    inside = form.group(2)
    return EffectKey(form.group(1), _options(text, [*(inside.split(",") if inside else []), *older]), size)


def _options(text: str, parts: Sequence[str]) -> dict[str, str]:
    pairs = [(name.strip(), value.strip()) for name, _, value in (part.partition("=") for part in parts)]
    if not all(name and value for name, value in pairs) or len(dict(pairs)) < len(pairs):
        raise DataError(f"effect '{text}': cannot read its options (expected option=value, each once)")
    return dict(pairs)


def _split(text: str) -> tuple[str, str]:
    """Cut a key at the first ``=`` outside brackets: what it names, and the size."""
    depth = 0
    for i, letter in enumerate(text):
        depth += (letter == "(") - (letter == ")")
        if letter == "=" and depth == 0:
            return text[:i].strip(), text[i + 1 :].strip()
    return text.strip(), ""


def read_options(key: EffectKey, expected: Mapping[str, str]) -> dict[str, float]:
    """Read the options of a key.

    `expected`: unit of each option. Gives the value of each option (SI), in the order of `expected`.
    """
    if set(key.options) != set(expected):
        example = variant({name: f"1 {unit}".removesuffix(" 1") for name, unit in expected.items()})
        wanted = f"expected {key.name}{example}" if expected else "it takes no options"
        given = f"not '{variant(key.options)}'" if key.options else "and no options are stated"
        raise DataError(f"effect '{key.name}': {wanted}, {given}")
    values = {
        name: read_quantity(f"effect '{key.name}': {name}", key.options[name], expected[name]) for name in expected
    }
    for name, value in values.items():
        if value < 0.0 or (value == 0.0 and name not in _FROM_ZERO):
            raise DataError(f"effect '{key.name}': {name} must be positive, not '{key.options[name]}'")
    return values


def read_quantity(what: str, text: str, unit: str) -> float:
    """Read a quantity whose unit must be written (SI); ppm and % count as units, only counts go without."""
    if unit != "1" and _PURE.fullmatch(text):
        raise DataError(f"{what}: '{text}' has no unit (expected something like '{text or 1} {unit}')")
    try:
        return parse_quantity(text, unit)
    except UnitError as error:
        raise DataError(f"{what}: {error}") from error


def sized(key: str, value: float, unit: str) -> str:
    """Write a key with its size: `value` (SI) in `unit`, to the last digit."""
    return f"{key}={float(from_si(value, unit))!r} {unit}"


def effect_of(name: str, model: Sequence[str]) -> str:
    """Find the effect of a coefficient: the longest effect name that `name` begins with, or `name` itself.

    What stands in brackets behind an effect (a time constant) is no part of its coefficients' names.
    """
    fits = [effect for effect in model if f"{name}_".startswith(f"{effect.partition('(')[0]}_")]
    return max(fits, key=len) if fits else name
