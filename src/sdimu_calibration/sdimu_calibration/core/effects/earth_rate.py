"""Earth rate where nobody knows the azimuth: its horizontal part as two unknowns.

A navigation filter estimates an azimuth error to first order about the azimuth that it has. Where the bias of the gyros
wanders by as much as Earth rate is large, that azimuth may be wrong by any angle, and the first order is worth nothing.
But azimuth shows in nothing else than Earth rate: in a frame that keeps the coarse azimuth, whatever that is, the
horizontal Earth rate is an unknown vector, and everything is linear in it.

The prior says how large that vector is and prefers no direction: the answer is the same for every convention.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import GYRO, REFERENCES, Effect, Parameter, Term
from sdimu_calibration.core.effects.imu_model import ImuModel, with_serving
from sdimu_calibration.core.effects.motion import Motion

NORTH, EAST = NAMES = ("earth_rate_north", "earth_rate_east")
"""Names of the two unknowns."""


def horizontal_earth_rate(latitude: float) -> Effect:
    """Make the effect of a horizontal Earth rate that is not the one of the assumed azimuth.

    `latitude`: of the site (rad). Its equation is ``dw = C_bn (north, east, 0)``: true minus assumed Earth rate, along
    North and East of the assumed azimuth.
    """
    sigma = horizontal(latitude) / float(np.sqrt(2.0))
    return Effect(
        name="earth_rate",
        title="horizontal Earth rate",
        equation="dw = C_bn (north, east, 0)",
        parameters=tuple(Parameter(name, "rad/s", "deg/h") for name in NAMES),
        terms=tuple(Term(channel, place) for place in range(len(NAMES)) for channel in GYRO),
        regressors=_directions,
        prior=dict.fromkeys(("navigation", "tactical", "mems"), sigma),
        group=REFERENCES,
        scope="recording",
        needs_table=True,
        # It changes with the attitude alone: the slope along rate and force is zero everywhere.
        linear=True,
    )


def of_any_direction(sensors: ImuModel, latitude: float) -> ImuModel:
    """Return a model with the effect whose prior of the whole Earth rate prefers no direction.

    `sensors`: with the effect; `latitude`: of the site (rad).
    """
    mean = sensors.mean.copy()
    mean[sensors.names.index(NORTH)] = -horizontal(latitude)
    return replace(sensors, mean=mean)


def with_any_direction(sensors: ImuModel, latitude: float) -> ImuModel:
    """Put a horizontal Earth rate of any direction behind a model, as two parameters that serve.

    `latitude`: of the site (rad).
    """
    effect = horizontal_earth_rate(latitude)
    sigmas, none = np.full(2, horizontal(latitude) / float(np.sqrt(2.0))), np.zeros(2)
    return of_any_direction(with_serving(sensors, [effect], sigmas, none, none), latitude)


def horizontal(latitude: float) -> float:
    """Size of the horizontal Earth rate (rad/s) at a latitude (rad); at the poles a millionth of Earth rate."""
    return earth.RATE * max(abs(float(np.cos(latitude))), 1e-6)


def _directions(motion: Motion) -> Floats:
    return np.ascontiguousarray(motion.C_nb[:, :2, :].reshape(len(motion.t), 6))
