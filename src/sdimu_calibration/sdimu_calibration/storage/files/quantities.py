"""Quantities as files state them: text with a unit (``"2 deg/s"``), read into SI or refused in one line."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from pydantic import BeforeValidator

from sdimu_calibration.core.units import from_si, parse_quantity

SMALLEST_SIGMA = 1e-40
"""Sigma (SI) of any coefficient at least: the squares of smaller ones, and what is divided by them, are no numbers."""


def quantity(expected: str) -> BeforeValidator:
    """Read text such as ``"2 deg/s"`` into SI, refusing every dimension but that of `expected`."""
    return BeforeValidator(lambda value: parse_quantity(_as_text(value, expected), expected))


def sigma_up_to(most: float, unit: str, words: Mapping[str, float]) -> BeforeValidator:
    """Read a sigma with a unit into SI, refusing one below zero or above `most` (SI); a word of `words` is its size."""
    others = " or ".join(filter(None, (", ".join([*words][:-1]), [*words][-1])))

    def read(value: Any) -> float:
        text = _as_text(value, unit)
        if text in words:
            return words[text]
        if not any(map(str.isdigit, text)):
            raise ValueError(f"'{text}' is no sigma (expected {others}, or something like '1 {unit}')")
        size = parse_quantity(text, unit)
        if not 0.0 <= size <= most:
            raise ValueError(f"'{value}' is no sigma from 0 to {from_si(most, unit):g} {unit}")
        return size

    return BeforeValidator(read)


def number_of(unit: str) -> BeforeValidator:
    """Read a number of a key that names its unit; the unit may stand behind it once more."""

    def read(value: Any) -> Any:
        if not isinstance(value, str):
            return value
        try:
            return float(value)
        except ValueError:
            return from_si(parse_quantity(value, unit), unit)

    return BeforeValidator(read)


def _as_text(value: Any, expected: str) -> str:
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise ValueError(f"expected a number with a unit, something like '1 {expected}'")
    return str(value)


def signed_quantity(value: Any) -> tuple[float, str]:
    """Read a number with any unit into SI and its unit: the effect that owns a prior knows its dimension."""
    text = _as_text(value, "ppm")
    unit, numbers = re.subn(r"^\s*[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?\s*", "", text)
    if not numbers:
        raise ValueError(f"'{text}' is not a number with a unit (expected something like '40 ppm' or '1 deg/h')")
    return parse_quantity(text, unit or "1"), unit


def quantity_of_any_unit(value: Any) -> tuple[float, str]:
    """Read a sigma with any unit into SI and its unit."""
    size, unit = signed_quantity(value)
    if size < 0.0:
        raise ValueError(f"'{value}' is below zero (expected a sigma)")
    if 0.0 < size < SMALLEST_SIGMA:
        raise ValueError(
            f"'{value}' is smaller than any sigma (at least {SMALLEST_SIGMA:g} in SI units; check its exponent)"
        )
    return size, unit
