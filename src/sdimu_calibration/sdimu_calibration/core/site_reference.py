"""What a calibration takes from its site: latitude and gravity as told, and what is relative to them.

Sources: W. Heiskanen, H. Moritz, "Physical Geodesy" (1967), section 2-22 (deflection of the vertical); C. Tscherning,
R. Rapp, "Closed covariance expressions for gravity anomalies ...", Ohio State University, report 208 (1974) (variance
of gravity); N. Pavlis et al., "The development and evaluation of the Earth Gravitational Model 2008", J. Geophys. Res.
117 (2012) (deflections by a model).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.units import from_si, to_si

SURVEYED, FROM_MAP, BY_FORMULA = "surveyed", "map", "formula"
"""Words for how something of the site was found."""
LATITUDE_SIGMAS = {SURVEYED: to_si(1e-6, "deg"), FROM_MAP: to_si(1e-3, "deg")}
"""Sigma of a geodetic latitude (rad): a satellite receiver with a reference station knows .1 m, a point on a map some
100 m."""
DEFLECTION_SIGMAS = {FROM_MAP: to_si(1.3, "arcsec"), BY_FORMULA: to_si(10.0, "arcsec")}
"""Sigma of the deflection in the meridian (rad): where the latitude has that of EGM2008 in it, against deflections that
were observed; and where it is that of the ellipsoid, 6.3 arcsec by the variance of gravity, and more near mountains."""
GRAVITY_SIGMAS = {SURVEYED: to_si(0.1, "mgal"), FROM_MAP: to_si(5.0, "mgal"), BY_FORMULA: to_si(42.0, "mgal")}
"""Sigma of gravity (m/s^2): a tie by gravimeter, the tide of the Earth not taken out; a map or model of anomalies; the
normal formula, off by the free-air anomaly, whose mean square over the Earth is 1795 mgal^2."""
_OF = {"normal": "WGS-84 normal gravity at the latitude", "standard": "a convention, as no site is stated"}
_OF["plumb"] = "its sigma has the deflection of the vertical in it"
"""Where a value is from that nobody told, in words."""


@dataclass(frozen=True)
class Reference:
    """A quantity of the site that the calibration measures against."""

    name: str
    """As an effect."""
    told: float
    sigma: float
    """`told`, `sigma`: as the site tells it (rad, m/s^2); a sigma of zero takes it at its word."""
    value: float
    value_sigma: float
    """`value`, `value_sigma`: with what the data say of it."""
    unit: str = ""
    display_unit: str = ""
    origin: str = "stated"
    """``stated``; of gravity also ``normal`` or ``standard``; of a latitude ``plumb`` where `sigma` and `value` are
    those of the plumb line."""
    relative: tuple[str, ...] = ()
    """Coefficients whose common part is the reference: where `sigma` is zero their sigmas are relative to it."""

    @property
    def words(self) -> str:
        """Name what is told, with where it is from."""
        kind = self.name.removeprefix("reference_")
        unit, digits = ("deg", 4) if self.unit == "rad" else (self.unit, 6)
        of = f" ({_OF[self.origin]})" if self.origin in _OF else ""
        return f"{kind} {from_si(self.told, unit):.{digits}f} {unit}{of}"

    @property
    def note(self) -> str:
        """Say what the data make of a reference that has a sigma, on one line."""
        unit = self.display_unit
        sigma, off, left = (from_si(v, unit) for v in (self.sigma, self.told - self.value, self.value_sigma))
        known = f", from +- {sigma:.3g} {unit}" if sigma else ""
        return (
            f"{self.words} was estimated, too{known}: what was told is too large by {off:.3g} +- "
            f"{left:.3g} {unit}; all sigmas take that into account"
        )


def relative_line(references: Sequence[Reference]) -> str:
    """Say which sigmas are relative to what is told; empty where none are."""
    parts = [
        f"{', '.join(r.relative)} to {r.words}{_usually_off(r)}"
        for r in references
        if r.relative and not (r.sigma or r.value_sigma)
    ]
    return f"sigmas are relative to the site as told: {'; '.join(parts)}" if parts else ""


def _usually_off(reference: Reference) -> str:
    """Say by how much a formula is off; nothing of a reference that is stated."""
    if reference.origin != "normal":
        return ""
    off = GRAVITY_SIGMAS[BY_FORMULA]
    size = f"{from_si(off, 'mgal'):.0f} mgal, scale factors by {from_si(off / reference.told, 'ppm'):.0f} ppm"
    return f", off by {size} (root mean square over the Earth): state gravity_m_s2, or gravity_sigma: {BY_FORMULA}"


def found(
    references: Sequence[Reference], names: Sequence[str], values: Floats, sigmas: Floats
) -> tuple[Reference, ...]:
    """Put in what a fit found.

    Parameters
    ----------
    names : sequence of str, length r
        Those that were estimated along.
    values, sigmas : ndarray, shape (r,)
        Told less true, and its sigma (SI).
    """
    off = dict(zip(names, zip(values.tolist(), sigmas.tolist(), strict=True), strict=True))
    return tuple(
        replace(r, value=r.told - off[r.name][0], value_sigma=off[r.name][1]) if r.name in off else r
        for r in references
    )
