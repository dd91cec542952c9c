"""Errors of what the test believes of its site; each equals a sensor error that turns with the attitude.

A wrong Earth rate d in NED looks like a gyro error ``-C_bn d``, a wrong gravity d like an accelerometer error ``C_bn
d``, in navigation as in Zw and Zf.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import ACCEL, GYRO, REFERENCES, Effect, Parameter, Term
from sdimu_calibration.core.effects.mass_unbalance import GYRO_MASS_UNBALANCE
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.effects.registry import register
from sdimu_calibration.core.effects.scale import ACCEL_SCALE
from sdimu_calibration.core.site_reference import Reference
from sdimu_calibration.core.specification import Site
from sdimu_calibration.core.units import STANDARD_GRAVITY

_STEP = 1e-4
"""Step of the latitude (rad) over which normal gravity is differentiated: its cubes are a part in 10^8."""


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
        parameters=(Parameter("reference_gravity", "m/s^2", "mgal"),),
        terms=tuple(Term(channel, 0) for channel in ACCEL),
        regressors=lambda m: _along(m, 2),
        prior=dict.fromkeys(("navigation", "tactical", "mems"), 1e-3),
        group=REFERENCES,
        scope="setup",
        needs_table=True,
        never_seen="a wrong gravity is a common scale factor of the accelerometers whatever the plan: survey it",
        typical="WGS-84 normal gravity: 10-50 mgal; a survey: below 1 mgal",
        description="Cannot be told from a common scale factor of the accelerometers, whatever the plan: quote it as a "
        "floor of the scale factor.",
        confused_with=("accel_scale",),
    )
)

SEEN_AS_GRAVITY = ACCEL_SCALE.labels
"""Coefficients that a wrong gravity changes all alike."""

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


SITE_REFERENCES = {LATITUDE.name: "arcmin", GRAVITY.name: "mgal"}
"""Names of the parameters of what a site tells, with the unit in which people read what they are off by."""
_RELATIVE = {
    LATITUDE.name: tuple(p.name for p in GYRO_MASS_UNBALANCE.parameters if p.name.rpartition("_")[2][0] == "d"),
    GRAVITY.name: ACCEL_SCALE.labels,
}
"""Coefficients that have a part in common which is the reference, whatever the plan: a gyro sees the Earth's rate along
the vertical as it sees force along its input axis, an accelerometer gravity as its scale factor."""


def told_of(site: Site | None, names: Sequence[str]) -> tuple[Reference, ...]:
    """List what a calibration takes from its site, as told.

    `site`: None for a run by hand without one, gravity is then standard gravity; `names`: coefficients of the result.
    """

    def one(effect: Effect, told: float, sigma: float, origin: str) -> Reference:
        (parameter,) = effect.parameters
        relative = tuple(name for name in _RELATIVE[effect.name] if name in names)
        units = parameter.unit, SITE_REFERENCES[parameter.name]
        return Reference(parameter.name, told, sigma, told, sigma, *units, origin, relative)

    if site is None:
        return (one(GRAVITY, STANDARD_GRAVITY, 0.0, "standard"),)
    normal = float(earth.normal_gravity(site.latitude_rad, site.height_m))
    gravity, origin = (site.gravity_m_s2, "stated") if site.gravity_m_s2 else (normal, "normal")
    latitude = "plumb" if site.deflection_sigma_rad else "stated"
    return (
        one(LATITUDE, site.latitude_rad, site.astronomic_latitude_sigma_rad, latitude),
        one(GRAVITY, gravity, site.gravity_sigma_m_s2, origin),
    )


def stated_references(site: Site) -> tuple[tuple[Effect, float], ...]:
    """Make the references of a site that are not taken at their word.

    Returns
    -------
    tuple of (Effect, float)
        Each with the sigma of its parameter, told minus true (rad, m/s^2). Where gravity is that of the latitude, a
        wrong latitude is a wrong gravity, too; a deflection of the vertical is none.
    """
    latitude, sigma = LATITUDE, site.astronomic_latitude_sigma_rad
    gravity = site.gravity_sigma_m_s2
    if sigma and not site.gravity_m_s2:
        # Normal gravity goes with the geodetic part of the error alone: what the sum of both says of that part.
        part, slope = (site.latitude_sigma_rad / sigma) ** 2, _slope(site)
        latitude = _with_gravity(part * slope)
        if gravity:
            # What it leaves open of that part. A gravity that is taken at its word stays so, and is told as that.
            gravity = float(np.hypot(gravity, slope * site.latitude_sigma_rad * site.deflection_sigma_rad / sigma))
    return tuple((effect, size) for effect, size in ((latitude, sigma), (GRAVITY, gravity)) if size > 0.0)


def stated_gravity(site: Site | None) -> tuple[tuple[Effect, float], ...]:
    """Make the reference of a run by hand, where latitude shows in nothing but gravity and the Earth's rate.

    Returns
    -------
    tuple of (Effect, float)
        With the sigma of gravity (m/s^2); none where it is taken at its word.
    """
    if site is None:
        return ()
    by_latitude = 0.0 if site.gravity_m_s2 else _slope(site) * site.latitude_sigma_rad
    sigma = float(np.hypot(site.gravity_sigma_m_s2, by_latitude))
    return ((GRAVITY, sigma),) if sigma > 0.0 else ()


def _slope(site: Site) -> float:
    """Change of normal gravity with latitude (m/s^2/rad); one-sided at a pole."""
    at, height = site.latitude_rad, site.height_m
    low, high = max(at - _STEP, -0.5 * np.pi), min(at + _STEP, 0.5 * np.pi)
    return float(earth.normal_gravity(high, height) - earth.normal_gravity(low, height)) / (high - low)


def _with_gravity(slope: float) -> Effect:
    """Make the effect of a latitude with which gravity changes (m/s^2/rad)."""
    if not slope:
        return LATITUDE
    return replace(
        LATITUDE,
        terms=tuple(Term(channel, 0) for channel in (*GYRO, *ACCEL)),
        regressors=lambda m: np.hstack([_latitude(m), slope * _along(m, 2)]),
    )
