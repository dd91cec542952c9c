"""The plan as the motion shows it, table angles unread: turns with axis, sense and rate; stops and how they lean."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.effects.effect import AXES
from sdimu_calibration.core.evidence.navigation_evidence import NavigationEvidence
from sdimu_calibration.core.plan import Plan, Turn

_SINGLE_AXIS = 0.9
"""Share of a turn about one body axis from which it is a turn about that axis: one about two axes at once has 0.71 of
it about either."""
_OBLIQUE = 0.35
"""Share of gravity along the second largest of the body axes from which a stop leans: 20 deg, more than any mount is
off."""
_ACCELERATION = 1.0
"""Angular acceleration (rad/s^2) of a plan that was seen: the motion does not tell the limit, and no sum needs it."""
_RATES_DIFFER = 1.5
"""Ratio of two rates from which they differ: measured rates of one command do not scatter by so much."""


@dataclass(frozen=True)
class TurnSeen:
    """One turn."""

    after_stop: int
    axis: int | None
    """Body axis, 0-2; None when it turned about several."""
    angle: float
    rate: float
    """`angle`, `rate`: signed angle (rad); rate in the middle of the turn (rad/s)."""
    minutes: float


@dataclass(frozen=True)
class PlanSeen:
    """What a test did."""

    turns: tuple[TurnSeen, ...]
    oblique: int
    """Stops at which gravity lies between the body axes."""
    dwell_minutes: float
    """Median length of a stop."""

    def one_sided(self) -> tuple[tuple[str, int], ...]:
        """Axes about which all turns have one sense: letter and sign."""
        out = []
        for axis in range(3):
            signs = {int(np.sign(t.angle)) for t in self.turns if t.axis == axis}
            if len(signs) == 1:
                out.append((AXES[axis], signs.pop()))
        return tuple(out)

    def one_rate(self) -> tuple[str, ...]:
        """Axes about which all turns have one rate."""
        out = []
        for axis in range(3):
            rates = [t.rate for t in self.turns if t.axis == axis]
            if rates and max(rates) < _RATES_DIFFER * min(rates):
                out.append(AXES[axis])
        return tuple(out)


def plan_seen(evidence: NavigationEvidence) -> PlanSeen:
    """Read turns and stops from the predicted motion of a diagnosis."""
    seen, times = evidence.seen, evidence.times
    turns = []
    for stop, start, end in times.turns:
        rows = (seen.t > start) & (seen.t - seen.dt < end)
        angle = np.sum(seen.w_table[rows] * seen.dt[rows, None], axis=0)
        path = float(np.sum(np.linalg.norm(seen.w_table[rows], axis=1) * seen.dt[rows]))
        axis = int(np.argmax(np.abs(angle)))
        rate = np.linalg.norm(seen.w_table[rows], axis=1)
        fast = rate > 0.5 * rate.max() if rows.any() and rate.max() > 0 else np.zeros(len(rate), dtype=bool)
        single = path > 0.0 and abs(angle[axis]) > _SINGLE_AXIS * path
        turns.append(
            TurnSeen(
                stop,
                axis if single else None,
                float(angle[axis]),
                float(np.median(rate[fast])) if fast.any() else 0.0,
                (end - start) / 60.0,
            )
        )
    oblique = 0
    for _, start, end in times.stops:
        rows = (seen.t > start) & (seen.t <= end)
        share = np.sort(np.abs(seen.a[rows].mean(axis=0))) if rows.any() else np.zeros(3)
        oblique += int(share[1] > _OBLIQUE)
    dwell = float(np.median([b - a for _, a, b in times.stops])) / 60.0 if times.stops else 0.0
    return PlanSeen(tuple(turns), oblique, dwell)


def as_plan(seen: PlanSeen | None) -> Plan | None:
    """Write the plan that was seen as a plan to begin with; None where a turn was about several axes, or none was.

    Angles are rounded to whole degrees and rates to tenths: the motion tells them to the mount and the scale factors.
    """
    if seen is None or not seen.turns or any(turn.axis is None for turn in seen.turns):
        return None
    dwell = max(1.0, round(60.0 * seen.dwell_minutes))
    turns = []
    for turn in seen.turns:
        angle, rate = round(math.degrees(turn.angle)), round(abs(math.degrees(turn.rate)), 1)
        if not angle or not rate or turn.axis is None:
            return None
        turns.append(Turn("XYZ"[turn.axis], math.radians(angle), math.radians(rate)))
    return Plan("seen", (dwell,) * (len(turns) + 1), tuple(turns), _ACCELERATION)
