"""Changes of a plan that every table can run that can run the plan.

Every change keeps the attitudes of the remaining stops and the axes of the turns: another dwell, another rate, the
other sense of a half turn, a turn split in halves, two turns about one axis merged. The order of the gimbals does not
matter.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from sdimu_calibration.core.plan import Plan, Turn


@dataclass(frozen=True)
class Abilities:
    """Rates, acceleration and dwells that the table may use."""

    rates_rad_s: tuple[float, ...]
    """Mean rates of turns."""
    acceleration_rad_s2: float
    dwells_s: tuple[float, ...]
    """Lengths of stops."""


def whole(plan: Plan, able: Abilities) -> Iterator[list[Plan]]:
    """Plans in which all stops, all rates and all half turns are changed together; lists by falling dwell."""
    dwells = sorted({plan.dwell_s, *((d,) * len(plan.dwell_s) for d in able.dwells_s)}, key=sum, reverse=True)
    rates = [[r] * len(plan.turns) for r in sorted(able.rates_rad_s, reverse=True)]
    if len(able.rates_rad_s) > 1:
        rates.append([able.rates_rad_s[k % len(able.rates_rad_s)] for k in range(len(plan.turns))])
    rates.append([t.rate_rad_s for t in plan.turns])
    signed = [t.angle_rad for t in plan.turns]
    for speeds in rates:
        for angles in (signed, _both_senses(plan.turns)):
            turns = tuple(Turn(t.axis, a, r) for t, a, r in zip(plan.turns, angles, speeds, strict=True))
            changed = replace(plan, turns=turns, acceleration_rad_s2=able.acceleration_rad_s2)
            yield [replace(changed, dwell_s=dwell) for dwell in dwells]


def single(plan: Plan, able: Abilities) -> Iterator[Plan]:
    """Plans that differ in one stop or one turn, those that save most first."""
    turns, dwell = plan.turns, plan.dwell_s
    for k in range(len(turns) - 1):
        if turns[k].axis == turns[k + 1].axis:
            yield _merged(plan, k)
    for k, one in enumerate(dwell):
        for length in sorted(able.dwells_s):
            if length != one:
                yield replace(plan, dwell_s=(*dwell[:k], length, *dwell[k + 1 :]))
    for k, turn in enumerate(turns):
        for rate in able.rates_rad_s:
            if rate != turn.rate_rad_s:
                yield _with(plan, k, replace(turn, rate_rad_s=rate))
        if _half(turn):
            yield _with(plan, k, replace(turn, angle_rad=-turn.angle_rad))
    for k, turn in enumerate(turns):
        if abs(turn.angle_rad) > math.radians(60.0):
            part = replace(turn, angle_rad=0.5 * turn.angle_rad)
            yield replace(
                plan,
                turns=(*turns[:k], part, part, *turns[k + 1 :]),
                dwell_s=(*dwell[: k + 1], min(able.dwells_s), *dwell[k + 1 :]),
            )


def _with(plan: Plan, k: int, turn: Turn) -> Plan:
    return replace(plan, turns=(*plan.turns[:k], turn, *plan.turns[k + 1 :]))


def _merged(plan: Plan, k: int) -> Plan:
    """Leave out the stop between turns k and k + 1, which are about one axis."""
    first, second = plan.turns[k], plan.turns[k + 1]
    angle = math.remainder(first.angle_rad + second.angle_rad, 2.0 * math.pi)
    dwell = (*plan.dwell_s[: k + 1], *plan.dwell_s[k + 2 :])
    if abs(angle) > 1e-9:
        return replace(
            plan, turns=(*plan.turns[:k], replace(first, angle_rad=angle), *plan.turns[k + 2 :]), dwell_s=dwell
        )
    # Back where it was: the stop before and the stop after are one.
    return replace(plan, turns=(*plan.turns[:k], *plan.turns[k + 2 :]), dwell_s=(*dwell[: k + 1], *dwell[k + 2 :]))


def _both_senses(turns: Sequence[Turn]) -> list[float]:
    """Angles with every second half turn about an axis in the other sense."""
    out, count = [], {"X": 0, "Y": 0, "Z": 0}
    for turn in turns:
        angle = turn.angle_rad
        if _half(turn):
            count[turn.axis] += 1
            angle = abs(angle) if count[turn.axis] % 2 else -abs(angle)
        out.append(angle)
    return out


def _half(turn: Turn) -> bool:
    return abs(abs(turn.angle_rad) - math.pi) < 1e-9
