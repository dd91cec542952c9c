"""Moves that a test chooses from."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sdimu_calibration.core.plan import Turn


@dataclass(frozen=True)
class Menu:
    """Moves to choose from."""

    angles_rad: tuple[float, ...] = tuple(math.radians(a) for a in (90.0, -90.0, 180.0, -180.0))
    oblique_rad: tuple[float, ...] = tuple(math.radians(a) for a in (45.0, -45.0))
    """`angles_rad`, `oblique_rad`: signed angles of turns about each axis; those of turns to stops between the axes,
    from which the gimbals of a table can make few turns: only for what is to be told apart, and back."""
    rate_rad_s: float = math.radians(10.0)
    """Mean rate."""
    slow_rad_s: float = math.radians(2.0)
    """A second rate, for what is to be told apart: functions of the rate differ between two."""
    acceleration_rad_s2: float = math.radians(20.0)
    shortest_s: float = 10.0
    longest_s: float = 60.0
    """`shortest_s`, `longest_s`: stops."""

    def turns(self, apart: bool, square: bool) -> tuple[Turn, ...]:
        """List the turns to choose from.

        `apart`: something is to be told apart. `square`: the test stands along the axes; between them it only goes
        back, or on.
        """
        angles = (*(self.angles_rad if square else ()), *(self.oblique_rad if apart or not square else ()))
        rates = (self.rate_rad_s, self.slow_rad_s) if apart else (self.rate_rad_s,)
        return tuple(Turn(axis, angle, rate) for axis in "XYZ" for angle in angles for rate in rates)
