"""Errors of what the test believes of its site; each equals a sensor error that turns with the attitude.

A wrong Earth rate d in NED looks like a gyro error ``-C_bn d``, a wrong gravity d like an accelerometer error ``C_bn
d``, in navigation as in Zw and Zf.
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import ACCEL, GYRO, REFERENCES, Effect, Parameter, Term
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.effects.registry import register
from sdimu_calibration.core.units import STANDARD_GRAVITY


def _along(motion: Motion, direction: int) -> Floats:
    """Direction N, E or D seen in b, shape (n, 3)."""
    return np.asarray(motion.C_nb[:, direction, :])


def _latitude(motion: Motion) -> Floats:
    """Change of Earth rate with latitude, ``-C_bn (-W sin, 0, -W cos)``: Earth rate turned about East."""
    w_ie_n = np.einsum("kij,kj->ki", motion.C_nb, motion.w - motion.w_table)
    return np.asarray(_along(motion, 2) * w_ie_n[:, :1] - _along(motion, 0) * w_ie_n[:, 2:])


GRAVITY = register(
    Effect(
        name="reference_gravity",
        title="gravity of the site",
        equation="df = C_bn (0, 0, dg)",
        parameters=(Parameter("reference_gravity", "m/s^2", "ug"),),
        terms=tuple(Term(channel, 0) for channel in ACCEL),
        regressors=lambda m: _along(m, 2),
        prior=dict.fromkeys(("navigation", "tactical", "mems"), 1e-3),
        group=REFERENCES,
        scope="setup",
        needs_table=True,
        never_seen="a wrong gravity is a common scale factor of the accelerometers whatever the plan: survey it",
        typical="WGS-84 normal gravity: 10-50 ug; a survey: below 1 ug",
        description="Cannot be told from a common scale factor of the accelerometers, whatever the plan: quote it as "
        "a floor of "
        "the scale factor.",
        confused_with=("accel_scale",),
    )
)

DEFLECTION_EAST = register(
    Effect(
        name="reference_deflection_east",
        title="deflection of the vertical, East",
        equation="df = C_bn (0, g eta, 0)",
        parameters=(Parameter("reference_deflection_east", "rad", "arcsec"),),
        terms=tuple(Term(channel, 0) for channel in ACCEL),
        regressors=lambda m: STANDARD_GRAVITY * _along(m, 1),
        prior=dict.fromkeys(("navigation", "tactical", "mems"), 5e-5),
        group=REFERENCES,
        scope="setup",
        needs_table=True,
        never_seen="a deflection to the East is an azimuth whatever the plan",
        typical="1-20 arcsec",
        description="Cannot be told from azimuth; harmless for the coefficients.",
    )
)

LATITUDE = register(
    Effect(
        name="reference_latitude",
        title="latitude (or North deflection, or size of Earth rate)",
        equation="dw = -C_bn dw_ie/dlat dlat",
        parameters=(Parameter("reference_latitude", "rad", "arcsec"),),
        terms=tuple(Term(channel, 0) for channel in GYRO),
        regressors=_latitude,
        prior=dict.fromkeys(("navigation", "tactical", "mems"), 5e-3),
        group=REFERENCES,
        scope="setup",
        needs_table=True,
        typical="a gross error of the site file only",
        description="A wrong Earth rate in the meridian plane. Visible from some minutes of arc on.",
    )
)
