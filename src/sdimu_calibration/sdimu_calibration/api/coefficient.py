"""One coefficient with its sigma and units."""

from __future__ import annotations

from dataclasses import dataclass

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import from_si, parse_unit
from sdimu_calibration.report.table import with_sigma


@dataclass(frozen=True)
class Coefficient:
    """A coefficient.

    Attributes
    ----------
    value, sigma : float
        SI.
    unit, display_unit : str
        SI unit, and the customary one.
    """

    name: str
    value: float
    sigma: float
    unit: str
    display_unit: str

    def to(self, unit: str) -> tuple[float, float]:
        """Value and sigma in another unit, such as ``deg/h``."""
        if parse_unit(unit).dimension != parse_unit(self.unit).dimension:
            raise DataError(f"{self.name}: '{unit}' is of another kind than '{self.display_unit}'")
        return from_si(self.value, unit), from_si(self.sigma, unit)

    def __repr__(self) -> str:
        """Name, value and sigma in the customary unit."""
        value, sigma = self.to(self.display_unit)
        return f"{self.name} = {with_sigma(value, sigma, self.display_unit)}"
