"""A test plan as data: stops and the turns between them."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Turn:
    """One rotation of the table."""

    axis: str
    """``X``, ``Y`` or ``Z``: the IMU axis about which the table turns, right-hand positive."""
    angle_rad: float
    """Signed angle."""
    rate_rad_s: float
    """Mean rate over the turn (> 0)."""

    @property
    def duration_s(self) -> float:
        """Length of the turn (s)."""
        return abs(self.angle_rad) / self.rate_rad_s


@dataclass(frozen=True)
class Plan:
    """Stops and turns: dwell 0, turn 0, dwell 1, ... turn n-1, dwell n."""

    name: str
    dwell_s: tuple[float, ...]
    """Length of each stop (s), one more than turns."""
    turns: tuple[Turn, ...]
    acceleration_rad_s2: float
    """Limit of the angular acceleration."""

    @property
    def duration_s(self) -> float:
        """Length of the whole test (s)."""
        return sum(self.dwell_s) + sum(t.duration_s for t in self.turns)

    def backwards(self) -> Plan:
        """Return the plan in the opposite order; as the function `backwards`."""
        return backwards(self)


def backwards(plan: Plan) -> Plan:
    """Return a plan with the stops and turns in the opposite order, every turn in the other sense.

    It begins as every plan does, with the IMU level: it passes many of the same attitudes at other times.
    """
    turns = tuple(replace(turn, angle_rad=-turn.angle_rad) for turn in reversed(plan.turns))
    return replace(plan, name=f"{plan.name}_backwards", dwell_s=tuple(reversed(plan.dwell_s)), turns=turns)
