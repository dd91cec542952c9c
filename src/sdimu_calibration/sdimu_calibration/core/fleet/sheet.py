"""The lines of a data sheet: what was measured, how well, and what it says against a limit."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

PASS, FAIL, UNDECIDED, NOT_MEASURED = "pass", "fail", "undecided", "not measured"
"""What a line says against a limit."""


@dataclass(frozen=True)
class Line:
    """One term of a data sheet."""

    term: str
    """Such as ``gyro scale-factor error``."""
    unit: str
    display_unit: str
    """`unit`, `display_unit`: SI, and as people read it."""
    value: float = math.nan
    """Largest size over axes and units (SI); NaN: not measured."""
    low: float = math.nan
    high: float = math.nan
    """`low`, `high`: its interval at 95 % (SI); NaN where the source says none."""
    rms: float = math.nan
    """Root mean square over axes and units (SI); NaN where that has no meaning."""
    of: str = ""
    """Coefficient and unit with the largest size."""
    recordings: int = 0
    units: int = 0
    """`recordings`, `units`: how many it is from."""
    method: str = ""
    """How it was found."""
    condition: str = ""
    """Site, temperatures, rates."""
    missing: str = ""
    """What would measure it; empty where it was measured."""
    limit: float = math.nan
    """Largest size allowed (SI); NaN without a limit."""

    @property
    def is_bound(self) -> bool:
        """Whether nothing was seen of it, so that only the upper end of its interval is known."""
        return self.value == 0.0 and math.isfinite(self.high) and self.high > 0.0

    @property
    def verdict(self) -> str:
        """Say whether the limit is kept: only if the whole interval is inside; empty without a limit."""
        if math.isnan(self.limit):
            return ""
        if math.isnan(self.value):
            return NOT_MEASURED
        if self.high <= self.limit:
            return PASS
        return FAIL if self.low > self.limit else UNDECIDED

    def against(self, limit: float) -> Line:
        """Return the line with a limit (SI)."""
        return replace(self, limit=limit)
