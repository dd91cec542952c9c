"""Equations in the calibrator's names with a size, such as ``gyro_x: ey^2=0.1 deg/h``, for the true motion."""

from __future__ import annotations

import math
import re
from fractions import Fraction

from sdimu_calibration.core.effect_key import EffectKey, read_quantity
from sdimu_calibration.core.expression import VARIABLES, dimension_of, equation_text, reciprocal_unit
from sdimu_calibration.core.expression import parse_expression as parse_with_units
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import STANDARD_GRAVITY, UnitError, parse_unit
from sdimu_sim.core.expression import Expression, parse_expression, with_values

CONSTANTS: dict[str, float] = {
    "g": STANDARD_GRAVITY,
    "ug": 1e-6 * STANDARD_GRAVITY,
    "mg": 1e-3 * STANDARD_GRAVITY,
    "deg": math.pi / 180.0,
    "s": 1.0,
    "h": 3600.0,
    "ppm": 1e-6,
    "pi": math.pi,
}

_UNITS = {"s": "s", "h": "s", "g": "m/s^2", "ug": "m/s^2", "mg": "m/s^2"}
"""Units of `CONSTANTS` that are no numbers."""
_DIMENSIONS = {
    **{name: dimension_of(variable.unit) for name, variable in VARIABLES.items()},
    **{name: dimension_of(_UNITS.get(name, "1")) for name in CONSTANTS},
}
_MEANT = {"T": "dT"}
"""Names that the simulator's own formulas use otherwise: the calibrator's temperature counts from the start."""
_QUANTITY = re.compile(r"(\d[\d.]*) (s|deg)\b")
"""A period or a phase in an equation that a diagnosis proposes."""


def read_equation(key: EffectKey, sensor: str, formula: str) -> tuple[str, Expression, float]:
    """Read an equation.

    Parameters
    ----------
    key : EffectKey
        With its size; its option `name` says of which coefficient of an effect file it is a part.

    Returns
    -------
    (str, Expression, float)
        Name that an estimate has; formula times k in the variables of `sdimu_sim.core.hidden`; k (SI).
    """
    text = equation_text(_QUANTITY.sub(r"(\1*\2)", formula))
    known = frozenset(_DIMENSIONS)
    expression = with_values(parse_expression(f"k*({text})", (*known, "k")), _MEANT)
    if "name" in key.options:
        # Checked with its file; the constants in it are bare numbers here.
        number, _, unit = key.size.partition(" ")
        return key.options["name"], expression, float(number) * parse_unit(unit).factor
    try:
        below = reciprocal_unit(parse_with_units(text, known).dimension(_DIMENSIONS))
        expected, given = ("deg/h" if sensor.startswith("gyro") else "ug") + below, key.size.lstrip("+-.0123456789eE ")
        if not key.size:
            raise DataError(f"effect '{key.name}' has no size (expected something like '{key.name}=1 {expected}')")
        fits = given and _without_angle(given) == _without_angle(expected)
        return key.name, expression, read_quantity(f"effect '{key.name}'", key.size, given if fits else expected)
    except UnitError as error:
        raise DataError(f"effect '{key.name}': {error}") from error


def _without_angle(unit: str) -> dict[str, Fraction]:
    """Dimension of a unit; per rad/s and per 1/s are the same, as in the calibrator's check of formulas."""
    return {name: power for name, power in parse_unit(unit).dimension if name != "rad"}
