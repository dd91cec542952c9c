"""The table of coefficients as text for other programs, in customary units."""

from __future__ import annotations

from collections.abc import Sequence

from sdimu_calibration.report.table import Row


def as_yaml(rows: Sequence[Row], body_frame: str) -> str:
    """Coefficients as YAML: a map from name to value, sigma and unit."""
    lines = [f"body_frame: {body_frame}", "coefficients:"]
    lines += [
        f"  {row.name}: {{value: {row.value:.9g}, sigma: {row.sigma:.4g}, unit: {_quoted(row.unit)}}}" for row in rows
    ]
    return "\n".join(lines) + "\n"


def as_csv(rows: Sequence[Row]) -> str:
    """Coefficients as comma-separated values with a heading."""
    lines = ["name,value,sigma,unit", *(f"{row.name},{row.value:.9g},{row.sigma:.4g},{row.unit}" for row in rows)]
    return "\n".join(lines) + "\n"


def _quoted(unit: str) -> str:
    """Quote: "1" is a unit, not a number."""
    return f'"{unit}"'
