"""Earth rate where nobody knows the azimuth: its horizontal part as two unknowns.

A navigation filter estimates an azimuth error to first order about the azimuth that it has. Where the bias of the gyros
wanders by as much as Earth rate is large, that azimuth may be wrong by any angle, and the first order is worth nothing.
But azimuth shows in nothing else than Earth rate: in a frame that keeps the coarse azimuth, whatever that is, the
horizontal Earth rate is an unknown vector, and everything is linear in it.
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import GYRO, REFERENCES, Effect, Parameter, Term
from sdimu_calibration.core.effects.motion import Motion

NORTH, EAST = NAMES = ("earth_rate_north", "earth_rate_east")
"""Names of the two unknowns."""


def horizontal_earth_rate(latitude: float) -> Effect:
    """Make the effect of a horizontal Earth rate that is not the one of the assumed azimuth.

    Parameters
    ----------
    latitude : float
        Of the site (rad).

    Returns
    -------
    Effect
        ``dw = C_bn (north, east, 0)``: true minus assumed Earth rate, along North and East of the assumed azimuth. The
        prior is the size of the horizontal Earth rate.
    """
    size = max(earth.RATE * abs(float(np.cos(latitude))), earth.RATE * 1e-6)
    return Effect(
        name="earth_rate",
        title="horizontal Earth rate",
        equation="dw = C_bn (north, east, 0)",
        parameters=tuple(Parameter(name, "rad/s", "deg/h") for name in NAMES),
        terms=tuple(Term(channel, place) for place in range(len(NAMES)) for channel in GYRO),
        regressors=_directions,
        prior=dict.fromkeys(("navigation", "tactical", "mems"), size),
        group=REFERENCES,
        scope="recording",
        needs_table=True,
    )


def _directions(motion: Motion) -> Floats:
    return np.ascontiguousarray(motion.C_nb[:, :2, :].reshape(len(motion.t), 6))
