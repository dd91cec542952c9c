"""YAML of our own: matrices, biases, and the coefficients with sigma, in SI (format ``sdimu-compensation/1``)."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.compensation import LinearModel
from sdimu_calibration.storage.export.shared import Source, bent, comments, flow, number


def texts(source: Source) -> dict[str, str]:
    """Return the text of the file."""
    linear, c = source.linear, source.calibration
    lines = comments(source, "#")
    lines += ["format: sdimu-compensation/1", f"body_frame: {linear.body_frame}"]
    for name, block in (("M_g", linear.gyro), ("G", linear.by_force), ("M_a", linear.accel)):
        lines += [f"{name}:", *(f"  - {flow(values)}" for values in block)]
    lines += [f"b_g: {flow(linear.gyro_bias)}", f"b_a: {flow(linear.accel_bias)}", "coefficients:"]
    sigma = np.sqrt(np.diag(c.covariance))
    for k, name in enumerate(c.names):
        text = f"{{value: {number(c.values[k])}, sigma: {number(sigma[k])}, unit: '{c.units[k]}'}}"
        lines.append(f"  {name}: {text}")
    return {"": "\n".join(lines) + "\n"}


def cannot_hold(linear: LinearModel) -> list[str]:
    """Say what is left out of the matrices; the list of coefficients has it."""
    return [f"{text}; among the coefficients below" for text in bent(linear)]
