"""What an estimate should find: the true coefficients and sizes of effects in a body frame."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.rotation import rotation_vector
from sdimu_sim.core.hidden import parse_effects
from sdimu_sim.core.truth import (
    UNBALANCE,
    ImuTruth,
    elements,
    in_body_frame,
    input_axes,
    triad_rotation,
    unbalance_elements,
    unbalance_matrix,
)

POWERS = ("temperature", "temperature_squared", "temperature_cubed")
"""Powers of the temperature, as they stand in the names of effects."""
SEEN_OF_TURNS = tuple(f"gyro_bias_temperature_rate{power}" for power in ("", "_linear", "_quadratic"))
"""Effects by which gyros see axes that turn with each of `POWERS`."""
_SPAN_K = np.linspace(-50.0, 50.0, 11)
"""Temperatures about T0 (K) at which the turned sensor is read: the range in which an IMU is used."""
_STEP_K = 0.01
"""Step of central differences (K): the third power of the temperature leaves a share of 1e-7."""
_TRIADS = ("gyro", "accel")
_TWINS = {
    f"gyro_mass_unbalance_{part}": f"gyro_g_sensitivity_{'xyz'[gyro]}{'xyz'[force]}"
    for part, (gyro, force) in UNBALANCE.items()
}
"""The other name of each mass unbalance: the same place of the matrix that multiplies the force."""


def true_coefficients(truth: ImuTruth, frame: str) -> dict[str, float]:
    """State a sensor by what a calibration estimates of it, in a named body frame.

    Where the axes of the accelerometers turn with the temperature, the frame ``accelerometer_triad`` is that of the
    accelerometers at every temperature: the sensor is turned exactly at temperatures over the range, and what it is
    there is written as polynomials again. The gyros see how the frame turns, as a bias that follows the rate.

    Parameters
    ----------
    frame : str
        ``prior`` or ``accelerometer_triad``.

    Returns
    -------
    dict of str to float
        The thirty coefficients and the size of every named effect, SI.
    """
    sizes = dict(parse_effects(truth.effects).sizes)
    coefficients = dict(truth.coefficients)
    for other, name in one_coefficient(sizes):
        coefficients[name] = coefficients.get(name, 0.0) + sizes[other]
    out = in_body_frame(coefficients, frame) | sizes
    if frame != "prior" and any(name.startswith("accel_misalignment_temperature") for name in sizes):
        out |= _turned(coefficients, sizes)
    return out | {other: out[name] for other, name in one_coefficient(sizes)}


def one_coefficient(names: Iterable[str]) -> list[tuple[str, str]]:
    """Find the hidden effects that are a mass unbalance by another name: the same force in the same gyro.

    A test shows their sum, which is the true value under either name.

    Gives the g-sensitivity and the mass unbalance of each such pair.
    """
    return [(_TWINS[name], name) for name in _TWINS if _TWINS[name] in set(names)]


def _turned(coefficients: Mapping[str, float], sizes: Mapping[str, float]) -> dict[str, float]:
    """Polynomials of axes, scale factors and mass unbalance in the frame of the accelerometers at each temperature."""
    axes = {triad: _at(input_axes(triad, coefficients), triad, sizes) for triad in _TRIADS}
    unbalance = _with_powers(
        unbalance_matrix(coefficients), [unbalance_matrix(_of_power(sizes, power)) for power in POWERS]
    )
    R = np.array([triad_rotation(M) for M in axes["accel"]])
    out: dict[str, float] = {}
    for order, power in enumerate(POWERS, start=1):
        for triad, M in axes.items():
            part = _power_of(M @ R.transpose(0, 2, 1), order)
            out |= {_named(name, power): value for name, value in elements(triad, part + np.eye(3)).items()}
        part = _power_of(unbalance @ R.transpose(0, 2, 1), order)
        out |= {_named(name, power): value for name, value in unbalance_elements(part).items()}
    ahead, behind = (accelerometer_frames(coefficients, sizes, _SPAN_K + step) for step in (_STEP_K, -_STEP_K))
    turn = [rotation_vector(one @ other.T) / (2.0 * _STEP_K) for one, other in zip(behind, ahead, strict=True)]
    seen = np.einsum("kij,klj,kl->ki", axes["gyro"], R, np.array(turn))
    for order, effect in enumerate(SEEN_OF_TURNS):
        for axis, value in zip("xyz", _power_of(seen, order), strict=True):
            name = f"{effect}_{axis}"
            out[name] = sizes.get(name, 0.0) - float(value)
    return out


def accelerometer_frames(coefficients: Mapping[str, float], sizes: Mapping[str, float], above_k: Floats) -> Floats:
    """Turn from the body frame in which a sensor was built to that of its accelerometers: R in v_triad = R v_b.

    Parameters
    ----------
    above_k : ndarray, shape (k,)
        Temperatures of the sensors above T0 (K).

    Returns
    -------
    ndarray, shape (k, 3, 3)
    """
    axes = _at(input_axes("accel", coefficients), "accel", sizes, above_k)
    return np.array([triad_rotation(M) for M in axes])


def _at(constant: Floats, triad: str, sizes: Mapping[str, float], above_k: Floats = _SPAN_K) -> Floats:
    """Input axes of a triad at each temperature (K above T0), shape (k, 3, 3)."""
    small = [_of_power(sizes, power) for power in POWERS]
    return _with_powers(constant, [_small_errors(triad, part) for part in small], above_k)


def _with_powers(constant: Floats, parts: list[Floats], above_k: Floats = _SPAN_K) -> Floats:
    """Sum ``constant + parts[n - 1] x^n`` at each temperature, shape (k, 3, 3)."""
    return np.asarray(constant + sum(np.multiply.outer(above_k ** (n + 1), part) for n, part in enumerate(parts)))


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
        name.replace(f"_{power}_", "_"): size
        for name, size in sizes.items()
        if name.rpartition("_")[0].endswith(f"_{power}")
    }


def _named(name: str, power: str) -> str:
    group, _, part = name.rpartition("_")
    return f"{group}_{power}_{part}"


def _power_of(values: Floats, order: int) -> Floats:
    """Coefficient of one power of the temperature in values at `_SPAN_K`, shape (k, ...)."""
    flat = values.reshape(len(values), -1)
    # Orders beyond those that are stated take what the turn adds there.
    found = np.polynomial.polynomial.polyfit(_SPAN_K, flat, len(POWERS) + 5)
    return np.asarray(found[order].reshape(values.shape[1:]))
