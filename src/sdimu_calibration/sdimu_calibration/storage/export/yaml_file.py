"""YAML of our own: matrices, biases, and the coefficients with sigma, in SI (format ``sdimu-compensation/1``)."""

from __future__ import annotations

import re

import numpy as np

from sdimu_calibration.core.compensation import LinearModel, Part
from sdimu_calibration.storage.export.shared import (
    Source,
    bent,
    by_temperature,
    comments,
    factor_text,
    flow,
    number,
    warm,
)

_BARE = re.compile(r"[a-z]+(_[a-z0-9]+)+")
"""Names of coefficients: nothing that YAML takes for a number, a date or its own syntax."""


def texts(source: Source) -> dict[str, str]:
    """Return the text of the file."""
    linear, c = source.linear, source.calibration
    lines = comments(source, "#")
    lines += ["format: sdimu-compensation/1", f"body_frame: {_scalar(linear.body_frame)}", *_blocks(linear, "")]
    parts = by_temperature(linear)
    if parts:
        lines += ["temperature:", f"  T0_degc: {number(linear.temperature_degc or 0.0)}", "  parts:"]
    for factor, part in parts.items():
        # Each part times this factor adds to the matrices and biases above.
        lines.append(f"    - times: {_scalar(factor_text(factor))}")
        lines += [f"      power: {factor.power}", f"      rate_power: {factor.rate_power}", *_blocks(part, "      ")]
    lines.append("coefficients:")
    sigma = np.sqrt(np.diag(c.covariance))
    for k, name in enumerate(c.names):
        text = f"{{value: {number(c.values[k])}, sigma: {number(sigma[k])}, unit: {_scalar(c.units[k])}}}"
        lines.append(f"  {_scalar(name)}: {text}")
    return {"": "\n".join(lines) + "\n"}


def _blocks(part: Part, indent: str) -> list[str]:
    """Matrices and biases, each line behind `indent`."""
    lines = []
    for name, block in (("M_g", part.gyro), ("G", part.by_force), ("M_a", part.accel)):
        lines += [f"{indent}{name}:", *(f"{indent}  - {flow(values)}" for values in block)]
    return [*lines, f"{indent}b_g: {flow(part.gyro_bias)}", f"{indent}b_a: {flow(part.accel_bias)}"]


def _scalar(text: str) -> str:
    """Write a name or a unit so that YAML reads the same text, whatever stands in it."""
    return text if _BARE.fullmatch(text) else "'" + text.replace("'", "''") + "'"


def cannot_hold(linear: LinearModel) -> list[str]:
    """Say what is left out of the matrices; the list of coefficients has it."""
    unstated = warm(linear) if not by_temperature(linear) else []
    return [f"{text}; among the coefficients below" for text in bent(linear) + unstated]
