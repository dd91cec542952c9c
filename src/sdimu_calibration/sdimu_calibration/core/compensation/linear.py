"""The affine part of a result, as matrices and biases: ``m = A x + b``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.compensation.compensator import resolved
from sdimu_calibration.core.compensation.reads import reads, samples_motion
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.results import Calibration

_AFFINE = 1e-10
"""Deviation from a straight line, a share of the size of the regressor: above rounding, below any nonlinearity."""


@dataclass(frozen=True)
class LinearModel:
    """Sensors as matrices.

    ``rate measured = gyro w + by_force f + gyro_bias``, ``force measured = accel f + accel_bias``, with the body rate w
    and the specific force f in `body_frame`.

    Attributes
    ----------
    gyro, accel : ndarray, shape (3, 3)
        ``I + scale + misalignment``.
    by_force : ndarray, shape (3, 3)
        Mass unbalance and g-sensitivity ((rad/s)/(m/s^2)).
    gyro_bias, accel_bias : ndarray, shape (3,)
        rad/s, m/s^2.
    body_frame : str
    left : tuple of str
        Coefficients of effects that are not affine.
    """

    gyro: Floats
    accel: Floats
    by_force: Floats
    gyro_bias: Floats
    accel_bias: Floats
    body_frame: str
    left: tuple[str, ...]


def linear_model(calibration: Calibration, own: Sequence[Effect] = ()) -> LinearModel:
    """Collect every coefficient whose effect is affine in rate and force.

    Parameters
    ----------
    calibration : Calibration
    own : sequence of Effect
        Effects of the result that are in no catalogue.

    Returns
    -------
    LinearModel

    Raises
    ------
    DataError
        When the result does not fit its effects.
    """
    matrix, bias = np.eye(6), np.zeros(6)
    left: list[str] = []
    place = 0
    for effect in resolved(calibration, own):
        own_values = calibration.values[place : place + len(effect.parameters)]
        place += len(effect.parameters)
        constant, slope, bent = _shape(effect)
        for column, term in enumerate(effect.terms):
            name = effect.parameters[term.parameter].name
            if column in bent:
                left += [name] if name not in left else []
                continue
            bias[term.channel] += own_values[term.parameter] * constant[column]
            matrix[term.channel] += own_values[term.parameter] * slope[column]
    if np.any(matrix[3:, :3]):
        # No form in use lets an accelerometer see the rate.
        left.append("sensitivity of the accelerometers to rate")
    return LinearModel(
        matrix[:3, :3], matrix[3:, 3:], matrix[:3, 3:], bias[:3], bias[3:], calibration.body_frame, tuple(left)
    )


def _shape(effect: Effect) -> tuple[Floats, Floats, frozenset[int]]:
    """Regressor columns as ``constant + slope x``: (m,), (m, 6), and the columns that are not of this shape."""
    m = len(effect.terms)
    if effect.scope == "recording" or reads(effect) - {"w", "f"}:
        return np.zeros(m), np.zeros((m, 6)), frozenset(range(m))
    scale = np.array([1.0, 1.0, 1.0, 10.0, 10.0, 10.0])
    points = np.vstack([np.zeros(6), np.diag(scale), np.random.default_rng(5).normal(size=(40, 6)) * scale])
    zero = np.zeros(len(points))
    values = effect.regressors(samples_motion(zero, zero, points[:, :3], points[:, 3:], zero, zero))
    constant = values[0]
    slope = (values[1:7] - constant).T / scale
    off = np.abs(values - constant - points @ slope.T).max(axis=0)
    bent = off > _AFFINE * np.maximum(np.abs(values).max(axis=0), 1e-300)
    return constant, slope, frozenset(int(k) for k in np.flatnonzero(bent))
