"""Units: SI inside, customary units wherever a person reads or writes.

A unit is a product of named units with integer or half powers, written as people write them:
``deg/h``, ``ug/g^2``, ``deg/h/sqrt(Hz)``, ``ppm/degC``. It has a factor to SI and a dimension, and
only quantities of the expected dimension are accepted.

``g`` in a numerator is an acceleration (9.80665 m/s^2). ``g`` in a denominator is a dimension of its
own, because coefficients "per g" stay per g in SI files (rad/s per g), as in Kim, Song & Lyou.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

from sdimu_calibration.core.plain_text import one_line

STANDARD_GRAVITY = 9.80665
"""Standard gravity (m/s^2): the size of the unit g (CGPM 1901)."""

_DEG = math.pi / 180.0
"""Degree (rad): definition."""
ABSOLUTE_ZERO_DEGC = -273.15
"""Lowest temperature (degC): nothing is colder."""
LARGEST = 1e20
"""Largest number of a quantity (SI): beyond all that is measured, and its square and products stay numbers."""
_G = STANDARD_GRAVITY

# name -> (factor to SI, dimension as {base: power})
_NAMED: dict[str, tuple[float, dict[str, int]]] = {
    "1": (1.0, {}),
    "ppm": (1e-6, {}),
    "%": (1e-2, {}),
    "rad": (1.0, {"rad": 1}),
    "mrad": (1e-3, {"rad": 1}),
    "urad": (1e-6, {"rad": 1}),
    "deg": (_DEG, {"rad": 1}),
    "arcmin": (_DEG / 60.0, {"rad": 1}),
    "arcsec": (_DEG / 3600.0, {"rad": 1}),
    "s": (1.0, {"s": 1}),
    "ms": (1e-3, {"s": 1}),
    "us": (1e-6, {"s": 1}),
    "min": (60.0, {"s": 1}),
    "h": (3600.0, {"s": 1}),
    "Hz": (1.0, {"s": -1}),
    "m": (1.0, {"m": 1}),
    "mm": (1e-3, {"m": 1}),
    "cm": (1e-2, {"m": 1}),
    "km": (1e3, {"m": 1}),
    "g": (_G, {"m": 1, "s": -2}),
    "mg": (1e-3 * _G, {"m": 1, "s": -2}),
    "ug": (1e-6 * _G, {"m": 1, "s": -2}),
    "Gal": (1e-2, {"m": 1, "s": -2}),
    "mgal": (1e-5, {"m": 1, "s": -2}),
    "mGal": (1e-5, {"m": 1, "s": -2}),
    "ugal": (1e-8, {"m": 1, "s": -2}),
    "degC": (1.0, {"K": 1}),
    "K": (1.0, {"K": 1}),
    "G": (1e-4, {"T": 1}),
    "uT": (1e-6, {"T": 1}),
    "T": (1.0, {"T": 1}),
}


class UnitError(ValueError):
    """A unit that cannot be read, or a quantity of the wrong dimension; its text is one line for the user."""

    def __init__(self, text: str) -> None:
        super().__init__(one_line(text))


@dataclass(frozen=True)
class Unit:
    """A unit of measurement."""

    text: str
    """As written, for people."""
    factor: float
    """SI value of one unit."""
    dimension: tuple[tuple[str, Fraction], ...]
    """Base dimensions and powers, sorted, zero powers left out."""


@lru_cache(maxsize=1024)
def parse_unit(text: str) -> Unit:
    """Read a unit such as ``deg/h/sqrt(Hz)``.

    `text`: products with ``*`` or ``/`` of named units with ``^power``; ``sqrt(unit)`` halves the powers. Raises
    UnitError when a name in it is unknown.
    """
    factor = 1.0
    powers: dict[str, Fraction] = {}
    for sign, token in re.findall(r"([*/]?)\s*(sqrt\([^)]*\)|[^*/\s]+)", text.strip() or "1"):
        below = sign == "/"
        power = Fraction(-1 if below else 1)
        root = re.fullmatch(r"sqrt\((.*)\)", token)
        if root:
            power /= 2
        name, _, exponent = (root.group(1) if root else token).partition("^")
        if exponent:
            if not re.fullmatch(r"-?[0-9]{1,2}", exponent):
                raise UnitError(f"cannot read the power in unit '{text}'")
            power *= int(exponent)
        if name not in _NAMED:
            raise UnitError(f"unknown unit '{name}' in '{text}'")
        scale, base = (1.0, {"g": 1}) if name == "g" and below else _NAMED[name]
        factor *= scale ** float(power)
        for dim, n in base.items():
            powers[dim] = powers.get(dim, Fraction(0)) + n * power
    return Unit(text, factor, tuple(sorted((d, n) for d, n in powers.items() if n)))


def to_si(value: float, unit: str) -> float:
    """Convert a number in `unit` to SI."""
    return value * parse_unit(unit).factor


def from_si(value: float, unit: str) -> float:
    """Convert an SI number to `unit`."""
    return value / parse_unit(unit).factor


_QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*")


def parse_quantity(text: str | float, expected: str) -> float:
    """Read a quantity such as ``"2 deg/s"`` and return it in SI.

    Parameters
    ----------
    text : str or float
        Number and unit. A bare number is taken only where the expected unit is ``1``.
    expected : str
        A unit of the wanted dimension, for the check and the message.

    Raises
    ------
    UnitError
        When it is not a number with a unit of that dimension, or beyond `LARGEST`.
    """
    match = _QUANTITY.fullmatch(str(text))
    if not match:
        raise UnitError(f"'{text}' is not a number with a unit (expected something like '1 {expected}')")
    wanted = parse_unit(expected)
    written = match.group(2)
    if not written and expected != "1":
        raise UnitError(f"'{text}' has no unit (expected something like '{text} {expected}')")
    unit = parse_unit(written or "1")
    if unit.dimension != wanted.dimension:
        raise UnitError(f"'{text}' has the wrong unit (expected something like '1 {expected}')")
    value = float(match.group(1)) * unit.factor
    if not abs(value) <= LARGEST:
        raise UnitError(f"'{text}' is larger than any quantity (at most {LARGEST:g} in SI units; check its exponent)")
    return value
