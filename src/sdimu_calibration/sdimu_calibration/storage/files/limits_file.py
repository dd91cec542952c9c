"""Limits of a data sheet (YAML, format ``sdimu-limits/1``): term -> largest size with its unit."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import UnitError, parse_quantity
from sdimu_calibration.storage.files.config import Schema, read_yaml


class _LimitsFile(Schema):
    format: Literal["sdimu-limits/1"] = "sdimu-limits/1"
    name: str | None = None
    limits: dict[str, Any]


def read_limits(path: Path, terms: Mapping[str, str]) -> dict[str, float]:
    """Read limits. `terms`: unit of each term that a data sheet knows. Gives the largest size allowed (SI) by term."""
    out = {}
    for term, text in read_yaml(path, _LimitsFile).limits.items():
        if term not in terms:
            near = difflib.get_close_matches(term, terms, 1)
            hint = f"did you mean '{near[0]}'" if near else f"terms are {', '.join(terms)}"
            raise DataError(f"{path}: limits: unknown term '{term}' ({hint})")
        try:
            out[term] = parse_quantity(text, terms[term])
        except UnitError as error:
            raise DataError(f"{path}: limits: {term}: {error}") from error
        if out[term] <= 0.0:
            raise DataError(f"{path}: limits: {term}: '{text}' is not above zero (expected the largest size allowed)")
    if not out:
        raise DataError(f"{path}: limits: names no term (expected lines such as 'gyro bias: 0.01 deg/h')")
    return out
