"""A model whose body frame is that of the accelerometers from the start.

Turning the body frame changes no measurement (`body_frame`). With errors of arcminutes the priors hold that free turn
and nobody feels it. With errors of degrees it is the end of every iteration: the strong rows of the data cancel along
the turn only as well as the derivatives are right, and what does not cancel outweighs the priors. So here the turn is
no unknown: q_xy = q_xz = q_yx = 0 leave the model. Their polynomials of the temperature stay: the turn that they leave
free is small, and what is reported is turned to the frame at every temperature.

A model that has not all three of them has no such turn, or holds it by what it lacks: it stays as it is, and so does
one that is asked for in the frame of its priors.

What the turn takes along must be put back. Six of nine elements of the gyros' response to force are mass unbalance in
the frame in which the sensor was built; in the turned frame the other three are products of unbalance and
misalignment. They become parameters of that size that serve: estimated and not reported, as the turned frame has no
name for them.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.effects import body_frame, imu_model, registry
from sdimu_calibration.core.effects.effect import REFERENCES, Effect
from sdimu_calibration.core.effects.imu_model import ImuModel, with_serving
from sdimu_calibration.core.specification import ImuSpecification

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
    frame: str = FRAME
    """Of the report, one of `body_frame.FRAMES`."""
    turned: bool = True
    """The inner model is in the accelerometers' frame; else it is the one asked for, with what serves behind it."""

    def values(self, inner: Floats) -> Floats:
        """Read the parameters asked for out of the inner ones, shape (..., p); zero where the frame pins one.

        Parameters
        ----------
        inner : ndarray, shape (..., q)
            SI, in the accelerometers' frame.
        """
        if not self.turned:
            return body_frame.values_in_frame(self.asked.names, self._at_start(inner), self.frame)
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
        if self.turned:
            J = body_frame.temperature_jacobian(self.asked.names, self._at_start(about))
        else:
            J = body_frame.frame_jacobian(self.asked.names, self.frame)
        return np.asarray(J @ P @ J.T)


def squares_count(sensors: ImuModel) -> bool:
    """Tell whether the specification lets errors be so large that their squares count."""
    return bool(np.any(sensors.prior[scales_and_angles(sensors)] > LARGE))


def are_large(names: Sequence[str], weight: Floats) -> bool:
    """Tell the same as `squares_count` of coefficients by name.

    Parameters
    ----------
    names : sequence of str, length p
    weight : ndarray, shape (p,)
        Prior information of each (1/SI^2).
    """
    return any(_SCALE_OR_ANGLE.search(n) and w < LARGE**-2.0 for n, w in zip(names, weight.tolist(), strict=True))


def scales_and_angles(sensors: ImuModel) -> Ints:
    """List the places of scale factors and misalignments, ascending, shape (k,)."""
    found = [i for i, p in enumerate(sensors.parameters) if p.unit in ("1", "rad") and _SCALE_OR_ANGLE.search(p.name)]
    return np.array(found, dtype=np.int64)


def model_in_frame(asked: ImuModel, imu: ImuSpecification, frame: str) -> AccelerometerFrameModel:
    """Put a model into the accelerometers' frame where the report is asked for in it and the model can turn.

    `frame`: one of `body_frame.FRAMES`.
    """
    return (accelerometer_frame_model(asked, imu) if frame == FRAME else None) or as_asked(asked, frame)


def as_asked(asked: ImuModel, frame: str) -> AccelerometerFrameModel:
    """Leave a model in the frame of its priors, and turn what is reported; `frame` as for `model_in_frame`."""
    return AccelerometerFrameModel(asked, asked, np.arange(len(asked.prior)), frame, turned=False)


def accelerometer_frame_model(asked: ImuModel, imu: ImuSpecification) -> AccelerometerFrameModel | None:
    """Put a model into the accelerometers' frame; None where it cannot turn as not all misalignments are in it."""
    pinned = set(body_frame.pinned_names())
    if not pinned <= set(asked.names):
        return None
    effects: list[Effect] = []
    for effect in asked.effects:
        left = tuple(p.name for p in effect.parameters if p.name not in pinned)
        if left:
            effects.append(effect if len(left) == len(effect.parameters) else effect.only(left))
    unbalance = [i for i, n in enumerate(asked.names) if n.startswith("gyro_mass_unbalance_d")]
    inner = imu_model.build(effects, imu)
    sizes = dict(zip(inner.names, inner.prior, strict=True))
    turned = _turned_prior(asked)
    sizes |= dict(zip(asked.names, np.sqrt(np.diag(turned)), strict=True))
    stated = np.array([sizes[name] for name in inner.names])
    place = np.array([inner.names.index(n) if n in inner.names else -1 for n in asked.names])
    own = np.flatnonzero(asked.restated & (place >= 0))
    prior, mean, restated = stated.copy(), inner.mean.copy(), inner.restated.copy()
    prior[place[own]], mean[place[own]], restated[place[own]] = asked.prior[own], asked.mean[own], True
    inner = replace(inner, prior=prior, mean=mean, restated=restated, stated=stated)
    inner = replace(inner, correlation=_correlation(turned, np.where(asked.restated, -1, place), len(stated)))
    if unbalance:
        misalignment = asked.stated[asked.names.index("accel_misalignment_xy")]
        size = np.full(len(_OUTSIDE), np.sqrt(2.0) * misalignment * np.max(asked.stated[unbalance]))
        inner = with_serving(inner, [_turned_unbalance()], size, np.zeros(len(size)), np.zeros(len(size)))
    return AccelerometerFrameModel(asked, inner, place)


def _turned_unbalance() -> Effect:
    """Make the effect of what a turn of the frame makes of mass unbalance; its name is none of the catalogue's.

    The catalogue's effect of the same columns has the size that physics gives it, and is looked for beside this one.
    """
    whole = registry.get("gyro_g_sensitivity").only(_OUTSIDE)
    parameters = tuple(replace(p, name=f"turned_{p.name}") for p in whole.parameters)
    return replace(whole, name="turned_mass_unbalance", family="", parameters=parameters, group=REFERENCES, sheet="")


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
