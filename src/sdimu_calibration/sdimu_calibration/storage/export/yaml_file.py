"""YAML of our own: matrices, biases, and the coefficients with sigma, in SI (format ``sdimu-compensation/1``)."""

from __future__ import annotations

import re

import numpy as np

from sdimu_calibration.core.compensation import LinearModel
from sdimu_calibration.storage.export.shared import Source, bent, comments, flow, number

_BARE = re.compile(r"[a-z]+(_[a-z0-9]+)+")
"""Names of coefficients: nothing that YAML takes for a number, a date or its own syntax."""


def texts(source: Source) -> dict[str, str]:
    """Return the text of the file."""
    linear, c = source.linear, source.calibration
    lines = comments(source, "#")
    lines += ["format: sdimu-compensation/1", f"body_frame: {_scalar(linear.body_frame)}"]
    for name, block in (("M_g", linear.gyro), ("G", linear.by_force), ("M_a", linear.accel)):
        lines += [f"{name}:", *(f"  - {flow(values)}" for values in block)]
    lines += [f"b_g: {flow(linear.gyro_bias)}", f"b_a: {flow(linear.accel_bias)}", "coefficients:"]
    sigma = np.sqrt(np.diag(c.covariance))
    for k, name in enumerate(c.names):
        text = f"{{value: {number(c.values[k])}, sigma: {number(sigma[k])}, unit: {_scalar(c.units[k])}}}"
        lines.append(f"  {_scalar(name)}: {text}")
    return {"": "\n".join(lines) + "\n"}


def _scalar(text: str) -> str:
    """Write a name or a unit so that YAML reads the same text, whatever stands in it."""
    return text if _BARE.fullmatch(text) else "'" + text.replace("'", "''") + "'"


def cannot_hold(linear: LinearModel) -> list[str]:
    """Say what is left out of the matrices; the list of coefficients has it."""
    return [f"{text}; among the coefficients below" for text in bent(linear)]
