"""A model whose body frame is that of the accelerometers from the start, for errors of percents.

Turning the body frame changes no measurement (`body_frame`). With errors of arcminutes the priors hold that free turn
and nobody feels it. With errors of degrees it is the end of every iteration: the strong rows of the data cancel along
the turn only as well as the derivatives are right, and what does not cancel outweighs the priors. So here the turn is
no unknown: q_xy = q_xz = q_yx = 0 leave the model. Their polynomials of the temperature stay: the turn that they leave
free is small, and what is reported is turned to the frame at every temperature.

What the turn takes along must be put back. Six of nine elements of the gyros' response to force are mass unbalance in
the frame in which the sensor was built; in the turned frame the other three are products of unbalance and
misalignment. They become parameters of that size, estimated and not reported, as the turned frame has no name for them.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.effects import body_frame, imu_model, registry
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.effects.imu_model import ImuModel
from sdimu_calibration.core.specification import EPOCH_S, MOST_EPOCHS, ImuSpecification

FRAME = "accelerometer_triad"
_OUTSIDE = ("gyro_g_sensitivity_xz", "gyro_g_sensitivity_yz", "gyro_g_sensitivity_zx")
"""Elements of the gyros' response to force that are no mass unbalance."""
_SCALE_OR_ANGLE = re.compile("_(scale|misalignment)_")
"""Coefficients whose squares count; those of temperature, rate or time have other units, which say nothing of size."""
LARGE = 3e-3
"""Prior sigma of scale (1) or misalignment (rad) from which errors are large: its square is 9 ppm, the sigma of a good
test."""


@dataclass(frozen=True)
class AccelerometerFrameModel:
    """A model in the accelerometers' frame, and how its parameters lie in the model asked for."""

    asked: ImuModel
    inner: ImuModel
    """`asked`, `inner`: with p and q parameters."""
    place: Ints
    """Shape (p,). Place of each parameter asked for among the inner ones; -1 for what is zero by definition."""

    def values(self, inner: Floats) -> Floats:
        """Read the parameters asked for out of the inner ones, shape (..., p); zero where the frame pins one.

        Parameters
        ----------
        inner : ndarray, shape (..., q)
            SI, in the accelerometers' frame.
        """
        return body_frame.at_every_temperature(self.asked.names, self._at_start(inner))

    def _at_start(self, inner: Floats) -> Floats:
        """Read the parameters asked for in the frame at T0."""
        return np.asarray(np.where(self.place >= 0, inner[..., np.maximum(self.place, 0)], 0.0))

    def covariance(self, inner: Floats, about: Floats) -> Floats:
        """Read the covariance asked for out of that of the inner ones, shape (..., p, p); zero where pinned.

        Parameters
        ----------
        inner : ndarray, shape (..., q, q)
            SI, in the accelerometers' frame.
        about : ndarray, shape (q,)
            The parameters themselves: covariances turn about them.
        """
        at, known = np.maximum(self.place, 0), self.place >= 0
        P = inner[..., at[:, None], at] * np.outer(known, known)
        J = body_frame.temperature_jacobian(self.asked.names, self._at_start(about))
        return np.asarray(J @ P @ J.T)


def squares_count(sensors: ImuModel) -> bool:
    """Tell whether the specification lets errors be so large that their squares count."""
    linear = scales_and_angles(sensors)
    return bool(len(linear)) and float(np.max(sensors.prior[linear])) > LARGE


def scales_and_angles(sensors: ImuModel) -> Ints:
    """List the places of scale factors and misalignments, ascending, shape (k,)."""
    found = [i for i, p in enumerate(sensors.parameters) if p.unit in ("1", "rad") and _SCALE_OR_ANGLE.search(p.name)]
    return np.array(found, dtype=np.int64)


def drifting(sensors: ImuModel, imu: ImuSpecification, gravity: float, duration: float) -> bool:
    """Tell whether the gyros lose the attitude so far over the test that the square of that counts.

    An attitude wrong by a shows gravity too small by g a^2 / 2. It counts when this, at three sigma of the gyros' white
    noise over the test, exceeds three sigma of the mean force. In a long test a tenth of that counts: the ordinary
    passes then take the second order for knowledge of the common turn of all axes and move on for dozens of passes
    (12 h, navigation grade: by a third less each), where those of second order need five. Effects that change at
    random are left to the ordinary passes, as samples are corrected at constants here: for them the answer is no.

    `gravity`: m/s^2; `duration`: of the test (s).
    """
    if ((sensors.decay_rate > 0) | (sensors.drive > 0)).any():
        return False
    attitude = 3.0 * imu.gyro_white_noise * float(np.sqrt(duration))
    sigmas = 3.0 if duration <= MOST_EPOCHS * EPOCH_S else 0.3
    return bool(0.5 * gravity * attitude**2 > sigmas * imu.accel_white_noise / float(np.sqrt(duration)))


def accelerometer_frame_model(
    asked: ImuModel, imu: ImuSpecification, more: Sequence[Effect] = ()
) -> AccelerometerFrameModel | None:
    """Put a model into the accelerometers' frame; None where it cannot turn because not all misalignments are in it.

    `more`: what the estimator estimates along, behind all others, and does not report.
    """
    pinned = set(body_frame.pinned_names())
    if not pinned <= set(asked.names):
        return None
    effects: list[Effect] = []
    for effect in asked.effects:
        left = tuple(p.name for p in effect.parameters if p.name not in pinned)
        if left:
            effects.append(effect if len(left) == len(effect.parameters) else effect.only(left))
    unbalance = [i for i, n in enumerate(asked.names) if n.startswith("gyro_mass_unbalance_d")]
    outside = bool(unbalance) and not set(_OUTSIDE) & set(asked.names)
    if outside:
        effects.append(registry.get("gyro_g_sensitivity").only(_OUTSIDE))
    inner = imu_model.build([*effects, *more], imu)
    sizes = dict(zip(inner.names, inner.prior, strict=True))
    turned = _turned_prior(asked)
    sizes |= dict(zip(asked.names, np.sqrt(np.diag(turned)), strict=True))
    if outside:
        misalignment = asked.stated[asked.names.index("accel_misalignment_xy")]
        sizes |= dict.fromkeys(_OUTSIDE, float(np.sqrt(2.0) * misalignment * np.max(asked.stated[unbalance])))
    stated = np.array([sizes[name] for name in inner.names])
    place = np.array([inner.names.index(n) if n in inner.names else -1 for n in asked.names])
    own = np.flatnonzero(asked.restated & (place >= 0))
    prior, mean, restated = stated.copy(), inner.mean.copy(), inner.restated.copy()
    prior[place[own]], mean[place[own]], restated[place[own]] = asked.prior[own], asked.mean[own], True
    serving = sum(len(effect.parameters) for effect in more)
    inner = replace(inner, prior=prior, mean=mean, restated=restated, stated=stated, serving=serving)
    inner = replace(inner, correlation=_correlation(turned, np.where(asked.restated, -1, place), len(stated)))
    return AccelerometerFrameModel(asked, inner, place)


def _turned_prior(asked: ImuModel) -> Floats:
    """Covariance of the priors (SI) in the accelerometers' frame, shape (p, p)."""
    J = body_frame.frame_jacobian(asked.names, FRAME, by_temperature=False)
    return np.asarray(J @ np.diag(asked.stated**2) @ J.T)


def _correlation(turned: Floats, place: Ints, count: int) -> Floats:
    """Correlation of the priors of all `count` inner parameters, (q, q).

    The turn about an axis is in three misalignments, which correlates them by one half. A test may see each of them
    but for the turn, or one alone: what it sees then says where the others are to be expected.

    Parameters
    ----------
    turned : ndarray, shape (p, p)
        As `_turned_prior` gives it.
    place : ndarray of int, shape (p,)
        Of each parameter asked for among the inner ones; -1 where it has no part in the turn.
    """
    out, known = np.eye(count), np.flatnonzero((place >= 0) & (np.diag(turned) > 0.0))
    sigma = np.sqrt(np.diag(turned)[known])
    out[np.ix_(place[known], place[known])] = turned[np.ix_(known, known)] / np.outer(sigma, sigma)
    return out
