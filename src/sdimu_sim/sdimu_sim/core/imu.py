"""The sensors: true means in, readings out."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.units import STANDARD_GRAVITY
from sdimu_sim.core.samples import TrueSamples
from sdimu_sim.core.truth import ImuTruth, biases, child_rng, input_axes, unbalance_matrix


def response(truth: ImuTruth, true: TrueSamples) -> Floats:
    """Make the readings of the six sensors, shape (6, m), with the thirty coefficients and nothing else.

    ``input axis . true vector + bias``, and for gyros the mass unbalance times f/g.
    """
    gyro, accel = input_axes("gyro", truth.coefficients), input_axes("accel", truth.coefficients)
    unbalance = unbalance_matrix(truth.coefficients) / STANDARD_GRAVITY
    out = np.concatenate([_times(gyro, true.omega_ib), _times(accel, true.f_ib)])
    out[:3] += _times(unbalance, true.f_ib)
    bias = np.concatenate([biases("gyro", truth.coefficients), biases("accel", truth.coefficients)])
    result: Floats = out + bias[:, None]
    return result


def _times(M: Floats, v: Floats) -> Floats:
    # Term by term: a matrix product's digits would depend on the number of columns.
    return np.array([M[i, 0] * v[0] + M[i, 1] * v[1] + M[i, 2] * v[2] for i in range(3)])


class Electronics:
    """White noise, saturation and quantisation: what has a memory or a random stream of its own."""

    def __init__(self, truth: ImuTruth, interval_s: float, seed: int) -> None:
        self._interval = interval_s
        # A density is the sigma of a mean over 1 s; over dt it is larger by 1/sqrt(dt).
        self._sigma = (truth.gyro_white_noise / interval_s**0.5, truth.accel_white_noise / interval_s**0.5)
        self._rng = (child_rng(seed, "gyro_white_noise"), child_rng(seed, "accel_white_noise"))
        self._limit = (truth.gyro_limit_rad_s, truth.accel_limit_m_s2)
        self._step = (truth.gyro_step_rad, truth.accel_step_m_s)
        self._remainder = np.zeros((2, 3))

    def apply(self, readings: Floats) -> tuple[Floats, Floats]:
        """Finish a block of readings (6, m): body rate and specific force, shape (m, 3) each."""
        gyro, accel = (self._triad(k, np.ascontiguousarray(readings[3 * k : 3 * k + 3].T)) for k in (0, 1))
        return gyro, accel

    def _triad(self, k: int, values: Floats) -> Floats:
        if self._sigma[k]:
            values = values + self._sigma[k] * self._rng[k].standard_normal(values.shape)
        if np.isfinite(self._limit[k]):
            values = np.clip(values, -self._limit[k], self._limit[k])
        if self._step[k]:
            values = _count_pulses(values, self._step[k] / self._interval, self._remainder[k])
        return values


@compiled
def _count_pulses(values: Floats, step: float, remainder: Floats) -> Floats:
    """Whole pulses per sample; what is left over stays in the integrator (`remainder` (3,), in place)."""
    out = np.empty_like(values)
    for k in range(values.shape[0]):
        for i in range(3):
            total = values[k, i] + remainder[i]
            out[k, i] = step * np.round(total / step)
            remainder[i] = total - out[k, i]
    return out
