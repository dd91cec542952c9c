"""What a calibration takes from its site: latitude and gravity as told, and what is relative to them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from sdimu_calibration.core.units import from_si

_OF = {"normal": "WGS-84 normal gravity at the latitude", "standard": "a convention, as no site is stated"}
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
    """``stated``; of gravity also ``normal`` or ``standard``."""
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
        f"{', '.join(r.relative)} to {r.words}" for r in references if r.relative and not (r.sigma or r.value_sigma)
    ]
    return f"sigmas are relative to the site as told: {'; '.join(parts)}" if parts else ""


def found(references: Sequence[Reference], off: Mapping[str, tuple[float, float]]) -> tuple[Reference, ...]:
    """Put in what a fit found.

    `off`: told less true, and its sigma (SI), of those that were estimated along, by name.
    """
    return tuple(
        replace(r, value=r.told - off[r.name][0], value_sigma=off[r.name][1]) if r.name in off else r
        for r in references
    )
