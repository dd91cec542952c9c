"""What a rate table is to the one who drives it: joints, axes, limits."""

from __future__ import annotations

import math
from dataclasses import dataclass

AXES = ("X", "Y", "Z")


@dataclass(frozen=True)
class AxisLimits:
    """What one axis of a table can do."""

    rate_rad_s: float = math.radians(400.0)
    """Largest rate (rad/s)."""
    acceleration_rad_s2: float = math.radians(400.0)
    """Largest angular acceleration (rad/s^2)."""
    angle_rad: float = math.inf
    """Mechanical stops at plus and minus this angle (rad); infinite without stops."""
    cable_turns: float = math.inf
    """Turns away from zero, either way, that the cable allows; infinite with slip rings."""

    @property
    def reach_rad(self) -> float:
        """Largest angle either way that stops and cable allow (rad)."""
        return min(self.angle_rad, 2.0 * math.pi * self.cable_turns)

    def why_not(self, angle_rad: float) -> str:
        """Say which limit an angle (rad, counted through all turns) breaks; empty when none."""
        size, slack = abs(angle_rad), 1e-9
        if size > self.angle_rad + slack:
            return f"beyond the stop at {math.degrees(self.angle_rad):g} deg"
        if size > 2.0 * math.pi * self.cable_turns + slack:
            return f"beyond the {self.cable_turns:g} turns that the cable allows"
        return ""


@dataclass(frozen=True)
class RateTable:
    """A table with three axes, or one that turns about any platform axis."""

    name: str
    axes: tuple[str, str, str] | None
    """Platform axis letters about which outer, middle and inner axis turn when all angles are zero; None is a table
    that turns about any platform axis."""
    joints: tuple[str, str, str]
    """Names of outer, middle and inner joint in messages; of x, y, z without gimbals."""
    limits: tuple[AxisLimits, AxisLimits, AxisLimits]
    """One for each joint."""
    sample_rate_hz: float = 100.0
    """Grid of the breakpoints of a move (Hz)."""
