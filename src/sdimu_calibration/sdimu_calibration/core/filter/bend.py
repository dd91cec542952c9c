"""Second order along what the priors decide: a coefficient that a test does not show bends those that go along with it.

Passes end at the mode of the coefficients and give the covariance there. A misalignment that its prior of .6 deg alone
decides has 50 ppm in its half square; the scale factors that go along with it may be known to less. With t the
deviation of such a coefficient in its sigmas, all of them are ``x0 + b t + q t^2``: their mean is ``x0 + q``, their
covariance ``b b' + 2 q q'`` (moments of a standard normal variable).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.effects.accelerometer_frame import scales_and_angles
from sdimu_calibration.core.effects.imu_model import ImuModel
from sdimu_calibration.core.recording import DivergedError


@dataclass(frozen=True)
class Bend:
    """What the squares of coefficients that only priors decide add."""

    mean: Floats
    """To the coefficients (SI), shape (q,)."""
    covariance: Floats
    """To their covariance (SI), shape (q, q)."""


def bend(
    sensors: ImuModel, estimate: Floats, covariance: Floats, about: Callable[[Floats], tuple[Floats, Floats]]
) -> Bend:
    """Look one sigma to both sides along each coefficient whose square counts, the least known one first.

    The square of a scale factor or misalignment counts where it is more than the sigma of the best known one. Where the
    passes diverge a sigma away, nothing is said of that coefficient and of those after it.

    Parameters
    ----------
    sensors : ImuModel
        q parameters.
    estimate, covariance : ndarray, shapes (q,) and (q, q)
        Where the passes ended (SI).
    about : callable
        Of other coefficients, shape (q,), SI: estimate and covariance, shapes as above, of one pass about these.
    """
    mean, more = np.zeros_like(estimate), np.zeros_like(covariance)
    left, chosen = covariance.copy(), np.empty(0, dtype=np.int64)
    able = scales_and_angles(sensors)
    able = able[np.diag(covariance)[able] > 0.0]
    least = np.sqrt(np.diag(covariance)[able]).min(initial=np.inf)
    while len(able):
        k = int(able[np.argmax(np.diag(left)[able])])
        if left[k, k] <= least:
            break
        b = left[:, k] / np.sqrt(left[k, k])
        chosen, able = np.append(chosen, k), able[able != k]
        points = [estimate - b, estimate + b]
        try:
            sides = [_given(*about(point), chosen, point[chosen]) for point in points]
        except DivergedError:
            break
        q = 0.5 * (sides[0] + sides[1]) - estimate
        mean, more, left = mean + q, more + 2.0 * np.outer(q, q), left - np.outer(b, b)
    return Bend(mean, more)


def _given(estimate: Floats, covariance: Floats, known: Ints, values: Floats) -> Floats:
    """Coefficients (q,) given that some of them, `known`, have the `values`: mean of the normal distribution there."""
    gain = np.linalg.solve(covariance[np.ix_(known, known)], covariance[known])
    return np.asarray(estimate + gain.T @ (values - estimate[known]))
