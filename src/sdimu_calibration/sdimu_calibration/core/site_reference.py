"""What a calibration takes from its site: latitude and gravity as told, and what is relative to them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from sdimu_calibration.core import earth
from sdimu_calibration.core.specification import Site
from sdimu_calibration.core.units import STANDARD_GRAVITY, from_si

LATITUDE, GRAVITY = NAMES = ("reference_latitude", "reference_gravity")
"""Names that the two have as parameters."""
_RELATIVE = {
    LATITUDE: ("gyro_mass_unbalance_dx", "gyro_mass_unbalance_dy", "gyro_mass_unbalance_dz"),
    GRAVITY: ("accel_scale_x", "accel_scale_y", "accel_scale_z"),
}
"""Coefficients that have a part in common which is the reference, whatever the plan: a gyro sees the Earth's rate along
the vertical as it sees force along its input axis, an accelerometer gravity as its scale factor."""
_OF = {"normal": "WGS-84 normal gravity at the latitude", "standard": "a convention, as no site is stated"}
"""Where a value is from that nobody told, in words."""


@dataclass(frozen=True)
class Reference:
    """A quantity of the site that the calibration measures against.

    Attributes
    ----------
    name : str
        One of `NAMES`.
    told, sigma : float
        As the site tells it (rad, m/s^2); a sigma of zero takes it at its word.
    value, value_sigma : float
        With what the data say of it.
    unit, display_unit : str
    origin : str
        ``stated``; of gravity also ``normal`` or ``standard``.
    relative : tuple of str
        Coefficients whose common part is the reference: where `sigma` is zero their sigmas are relative to it.
    """

    name: str
    told: float
    sigma: float
    value: float
    value_sigma: float
    unit: str = ""
    display_unit: str = ""
    origin: str = "stated"
    relative: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """Name what is told, with where it is from."""
        kind = self.name.removeprefix("reference_")
        unit, digits = ("deg", 4) if self.name == LATITUDE else ("m/s^2", 6)
        of = f" ({_OF[self.origin]})" if self.origin in _OF else ""
        return f"{kind} {from_si(self.told, unit):.{digits}f} {unit}{of}"

    @property
    def note(self) -> str:
        """Say what the data make of a reference that has a sigma, on one line."""
        unit = self.display_unit
        sigma, off, left = (from_si(v, unit) for v in (self.sigma, self.told - self.value, self.value_sigma))
        return (
            f"{self.words} was estimated along, from +- {sigma:.3g} {unit}: told less true is {off:.3g} +- {left:.3g} "
            f"{unit}; all sigmas take it in"
        )


def relative_line(references: Sequence[Reference]) -> str:
    """Say which sigmas are relative to what is told; empty where none are."""
    parts = [f"{', '.join(r.relative)} to {r.words}" for r in references if r.relative and not r.sigma]
    return f"sigmas are relative to the site as told: {'; '.join(parts)}" if parts else ""


def found(references: Sequence[Reference], off: Mapping[str, tuple[float, float]]) -> tuple[Reference, ...]:
    """Put in what a fit found.

    Parameters
    ----------
    references : sequence of Reference
    off : mapping of str to (float, float)
        Told less true, and its sigma (SI), of those that were estimated along, by name.
    """
    return tuple(
        replace(r, value=r.told - off[r.name][0], value_sigma=off[r.name][1]) if r.name in off else r
        for r in references
    )


def told_of(site: Site | None, names: Sequence[str]) -> tuple[Reference, ...]:
    """List what a calibration takes from its site, as told.

    Parameters
    ----------
    site : Site or None
        None for a run by hand without one: gravity is then standard gravity.
    names : sequence of str
        Coefficients of the result.
    """

    def one(name: str, told: float, sigma: float, units: tuple[str, str], origin: str) -> Reference:
        relative = tuple(n for n in _RELATIVE[name] if n in names)
        return Reference(name, told, sigma, told, sigma, *units, origin, relative)

    force = ("m/s^2", "mgal")
    if site is None:
        return (one(GRAVITY, STANDARD_GRAVITY, 0.0, force, "standard"),)
    normal = float(earth.normal_gravity(site.latitude_rad, site.height_m))
    gravity, origin = (site.gravity_m_s2, "stated") if site.gravity_m_s2 else (normal, "normal")
    return (
        one(LATITUDE, site.latitude_rad, site.latitude_sigma_rad, ("rad", "arcmin"), "stated"),
        one(GRAVITY, gravity, site.gravity_sigma_m_s2, force, origin),
    )
