"""What an estimate should find: the true coefficients and sizes of effects in a body frame."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.rotation import rotation_vector
from sdimu_sim.core.hidden import parse_effects
from sdimu_sim.core.truth import (
    ImuTruth,
    elements,
    in_body_frame,
    input_axes,
    triad_rotation,
    unbalance_elements,
    unbalance_matrix,
)

_POWERS = ("temperature", "temperature_squared", "temperature_cubed")
_SPAN_K = np.linspace(-50.0, 50.0, 11)
"""Temperatures about T0 (K) at which the turned sensor is read: the range in which an IMU is used."""
_TRIADS = ("gyro", "accel")


def true_coefficients(truth: ImuTruth, frame: str) -> dict[str, float]:
    """State a sensor by what a calibration estimates of it, in a named body frame.

    Where the axes of the accelerometers turn with the temperature, the frame ``accelerometer_triad`` is that of the
    accelerometers at every temperature: the sensor is turned exactly at temperatures over the range, and what it is
    there is written as polynomials again. The gyros see how the frame turns, as a bias that follows the rate.

    Parameters
    ----------
    truth : ImuTruth
    frame : str
        ``prior`` or ``accelerometer_triad``.

    Returns
    -------
    dict of str to float
        The thirty coefficients and the size of every named effect, SI.

    Raises
    ------
    DataError
        For another frame.
    """
    sizes = dict(parse_effects(truth.effects).sizes)
    out = in_body_frame(truth.coefficients, frame) | sizes
    if frame != "prior" and any(name.startswith("accel_misalignment_temperature") for name in sizes):
        out |= _turned(truth.coefficients, sizes)
    return out


def _turned(coefficients: Mapping[str, float], sizes: Mapping[str, float]) -> dict[str, float]:
    """Polynomials of axes, scale factors and mass unbalance in the frame of the accelerometers at each temperature."""
    axes = {triad: _at(input_axes(triad, coefficients), triad, sizes) for triad in _TRIADS}
    unbalance = _with_powers(
        unbalance_matrix(coefficients), [unbalance_matrix(_of_power(sizes, power)) for power in _POWERS]
    )
    R = np.array([triad_rotation(M) for M in axes["accel"]])
    out: dict[str, float] = {}
    for order, power in enumerate(_POWERS, start=1):
        for triad, M in axes.items():
            part = _power_of(M @ R.transpose(0, 2, 1), order)
            out |= {_named(name, power): value for name, value in elements(triad, part + np.eye(3)).items()}
        part = _power_of(unbalance @ R.transpose(0, 2, 1), order)
        out |= {_named(name, power): value for name, value in unbalance_elements(part).items()}
    turn = _power_of(np.array([rotation_vector(R[len(R) // 2] @ at.T) for at in R]), 1)
    for axis, seen in zip("xyz", axes["gyro"][len(R) // 2] @ R[len(R) // 2].T @ turn, strict=True):
        name = f"gyro_bias_temperature_rate_{axis}"
        out[name] = sizes.get(name, 0.0) - float(seen)
    return out


def _at(constant: Floats, triad: str, sizes: Mapping[str, float]) -> Floats:
    """Input axes of a triad at each temperature of `_SPAN_K`, shape (k, 3, 3)."""
    small = [_of_power(sizes, power) for power in _POWERS]
    return _with_powers(constant, [_small_errors(triad, part) for part in small])


def _with_powers(constant: Floats, parts: list[Floats]) -> Floats:
    """Sum ``constant + parts[n - 1] x^n`` at each temperature, shape (k, 3, 3)."""
    return np.asarray(constant + sum(np.multiply.outer(_SPAN_K ** (n + 1), part) for n, part in enumerate(parts)))


def _small_errors(triad: str, part: Mapping[str, float]) -> Floats:
    """Matrix that scale factors and misalignments add: the effects of temperature are linear in them."""
    out = np.zeros((3, 3))
    for i, own in enumerate("xyz"):
        out[i, i] = part.get(f"{triad}_scale_{own}", 0.0)
        for j, about in enumerate("xyz"):
            # Turned about j, axis i moves along j x i.
            out[i] += part.get(f"{triad}_misalignment_{own}{about}", 0.0) * np.cross(np.eye(3)[j], np.eye(3)[i])
    return out


def _of_power(sizes: Mapping[str, float], power: str) -> dict[str, float]:
    """Sizes of one power of the temperature, by the names that the baseline has."""
    return {
        name.replace(f"_{power}_", "_"): size for name, size in sizes.items()
        if name.rpartition("_")[0].endswith(f"_{power}")
    }  # fmt: skip


def _named(name: str, power: str) -> str:
    group, _, part = name.rpartition("_")
    return f"{group}_{power}_{part}"


def _power_of(values: Floats, order: int) -> Floats:
    """Coefficient of one power of the temperature in values at `_SPAN_K`, shape (k, ...)."""
    flat = values.reshape(len(values), -1)
    # Orders beyond those that are stated take what the turn adds there.
    found = np.polynomial.polynomial.polyfit(_SPAN_K, flat, len(_POWERS) + 5)
    return np.asarray(found[order].reshape(values.shape[1:]))
