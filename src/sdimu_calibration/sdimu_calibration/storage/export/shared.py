"""What the forms share: their source, numbers without loss, and the words of the equation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.compensation import Factor, LinearModel, Part
from sdimu_calibration.core.plain_text import one_line
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.specification import ImuSpecification

EQUATION = (
    "rate measured  = M_g w + G f + b_g,   so   w = inv(M_g) (rate measured - G f - b_g)",
    "force measured = M_a f + b_a,         so   f = inv(M_a) (force measured - b_a)",
    "w: body rate (rad/s); f: specific force (m/s^2), at rest and level (0, 0, -9.8) for axes forward, right, down;",
    "M: 1 + scale + misalignment; G: mass unbalance and g-sensitivity ((rad/s)/(m/s^2)); b: biases.",
)


class Source(NamedTuple):
    """What a form is written from."""

    calibration: Calibration
    linear: LinearModel
    imu: ImuSpecification
    rate_hz: float
    missing: tuple[str, ...]


def number(value: float) -> str:
    """Write a number so that reading it gives the same one: YAML 1.1 takes ``3e-05`` for a text, ``3.0e-05`` not."""
    whole, e, power = repr(float(value)).partition("e")
    return f"{whole}{'' if '.' in whole or not e else '.0'}{e}{power}"


def row(values: Floats) -> str:
    """Numbers of one row with blanks between them."""
    return " ".join(number(v) for v in values)


def flow(values: Floats) -> str:
    """Numbers of one row as a YAML list."""
    return "[" + ", ".join(number(v) for v in values) + "]"


def comments(source: Source, mark: str) -> list[str]:
    """Lines that say what the file is, as comments."""
    lines = [
        "Calibrated IMU: what turns its samples into body rate and specific force.",
        f"Body frame: {source.linear.body_frame}.",
        *EQUATION,
    ]
    if source.linear.parts and source.linear.temperature_degc is not None:
        lines.append(f"M, G and b are those at the temperature T0 = {source.linear.temperature_degc:g} degC.")
        low, high = source.calibration.origin.temperature_low_degc, source.calibration.origin.temperature_high_degc
        if low <= high:
            lines.append(f"The calibration knows temperatures of {low:.1f} to {high:.1f} degC; beyond is a guess.")
    lines += [f"NOT IN THIS FILE: {text}" for text in source.missing]
    # Names come from a file: they must neither begin a line of their own nor end a comment of C.
    return [f"{mark} {one_line(line, None).replace('*/', '* /')}" for line in lines]


def by_temperature(linear: LinearModel) -> dict[Factor, Part]:
    """Parts that follow the temperature, of a result that says from which temperature they count; else none."""
    return {} if linear.temperature_degc is None else dict(linear.parts)


def factor_text(factor: Factor) -> str:
    """Write what a part is multiplied by."""
    power = "(T - T0)" + (f"^{factor.power}" if factor.power > 1 else "") if factor.power else ""
    return " ".join(word for word in (power, "dT/dt" if factor.rate_power else "") if word)


def warm(linear: LinearModel) -> list[str]:
    """Say that a form has no place for what follows the temperature: one line, or none."""
    if not linear.parts:
        return []
    names = ", ".join(linear.of_temperature)
    if linear.temperature_degc is None:
        return [f"{names} (the result does not say from which temperature they count)"]
    return [
        f"{names} (the numbers hold at {linear.temperature_degc:g} degC; --temperature states another, and the forms "
        "c-header and yaml hold the polynomial)"
    ]


def bent(linear: LinearModel) -> list[str]:
    """Say which coefficients matrices cannot hold."""
    return [f"{name} (not a matrix; use sdimu compensate)" for name in linear.left]


def cannot_hold(linear: LinearModel) -> list[str]:
    """Say what a form of the matrices and biases leaves out."""
    return bent(linear) + warm(linear)


def by_force(linear: LinearModel) -> list[str]:
    """Say that a form has no place for the gyros' sensitivity to force: one line, or none."""
    if not np.any(linear.by_force):
        return []
    largest = float(np.abs(linear.by_force).max())
    return [f"G: mass unbalance and g-sensitivity of the gyros, up to {largest:.3g} (rad/s)/(m/s^2)"]
