"""Plans that fit in the time available, by their length alone: a search in a given time begins with one of them."""

from __future__ import annotations

from collections.abc import Iterator

from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.plan_search.moves import Abilities, single, whole
from sdimu_calibration.core.planning.nominal import ramp_length
from sdimu_calibration.core.recording import DataError


def within(start: Plan, able: Abilities, minutes: float) -> Plan:
    """Shorten a plan until it fits: all stops and turns together, else one at a time, else as far as it goes.

    `minutes`: time available. Gives the longest that fits of those with all stops and turns changed together; the
    shortest where none fits; the start itself where it fits, or nothing shortens it.
    """
    limit = 60.0 * minutes * (1.0 + _ROUNDING)
    if start.duration_s <= limit:
        return start
    together = [plan for plans in whole(start, able) for plan in plans if _runs(plan)]
    fitting = [plan for plan in together if plan.duration_s <= limit]
    if fitting:
        return max(fitting, key=_length)
    best = min([start, *together], key=_length)
    while best.duration_s > limit:
        shorter = min(_runnable(best, able), key=_length, default=best)
        if shorter.duration_s >= best.duration_s:
            break
        best = shorter
    return best


_ROUNDING = 1e-9
"""Tolerance (1) of a length: rounding of a sum."""


def _length(plan: Plan) -> float:
    return plan.duration_s


def _runnable(plan: Plan, able: Abilities) -> Iterator[Plan]:
    return filter(_runs, single(plan, able))


def _runs(plan: Plan) -> bool:
    """Whether the acceleration suffices for all turns."""
    try:
        for number, turn in enumerate(plan.turns, start=1):
            ramp_length(turn, plan.acceleration_rad_s2, number)
    except DataError:
        return False
    return True
