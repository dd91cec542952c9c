"""Greedy search: changes of the whole plan first, then of one stop or turn at a time, while they improve the plan.

The result is better than the start, not the best possible plan.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.plan_search.bound import Bounds, Question, bounds
from sdimu_calibration.core.plan_search.moves import Abilities, single, whole
from sdimu_calibration.core.planning.nominal import ramp_length
from sdimu_calibration.core.recording import DataError

_ROUNDING = 1e-9
"""Tolerance (1) of a length: rounding of a sum."""
_SLACK = 1e-6
"""Tolerance of comparisons (min, or share of a limit): rounding."""
_WORTH_MIN = 0.05
"""Least time that a change must save (min): less is not worth another round."""
_WORTH_SHARE = 0.003
"""Least share of the worst ratio that a change must save: less is not worth another round."""


@dataclass(frozen=True)
class Goal:
    """Goal of the search."""

    limits: Mapping[str, float]
    """Largest sigma allowed by effect (SI). Empty: the plan that tells most of all coefficients together
    (`Bounds.spread`), in the time available."""
    minutes: float | None = None
    """Time available, in which the worst ratio of sigma to limit is minimised; None minimises the time."""


@dataclass(frozen=True)
class Found:
    """A plan, its bounds, its worst ratio of sigma to limit, and the number of plans evaluated to find it.

    Where there is no limit, `worst` is the spread of its bounds.
    """

    plan: Plan
    bounds: Bounds
    worst: float
    tried: int

    @property
    def minutes(self) -> float:
        """Length of the plan."""
        return self.plan.duration_s / 60.0


def search(
    start: Plan,
    asked: Question,
    able: Abilities,
    goal: Goal,
    tries: int = 150,
    progress: Callable[[str, float], None] | None = None,
) -> Found:
    """Search for a plan.

    Parameters
    ----------
    start : Plan
        Every change keeps the attitudes of its stops.
    tries : int
        Most plans to evaluate (about half a second each); one more where the start is longer than `minutes`.

    Returns
    -------
    Found
        The start itself when no change improves it. In `minutes` where any change makes it fit, whatever `tries`;
        else the shortest.
    """
    if not start.turns:
        raise DataError(
            f"{start.name}: a search changes the turns of a plan, and this one has none: begin with another"
        )
    if not goal.limits and goal.minutes is None:
        raise DataError("a plan needs a goal: state limits, or the minutes available")
    _check_numbers(goal)
    first = bounds(start, asked)
    _check_limits(goal, first)
    best = Found(start, first, _worst(first, goal), 1)
    fits = start if goal.minutes is None else within(start, able, goal.minutes)
    if fits is not start:
        told = bounds(fits, asked)
        best = Found(fits, told, _worst(told, goal), 2)
    tried = best.tried
    seen = {_key(start), _key(fits)}

    def consider(plan: Plan) -> bool:
        """Evaluate a plan; True when it is the best so far."""
        nonlocal best, tried
        if _key(plan) in seen or not _may_win(plan, best, goal):
            return False
        seen.add(_key(plan))
        tried += 1
        try:
            told = bounds(plan, asked)
        except DataError:
            return False  # a turn too fast for the acceleration
        if progress is not None:
            progress(f"{best.minutes:.1f} min, worst {best.worst:.2f} of its limit", min(1.0, tried / tries))
        new = Found(plan, told, _worst(told, goal), tried)
        if _better(new, best, goal):
            best = new
            return True
        return False

    for plans in whole(start, able):
        # Shorter stops give larger sigmas: when one length misses the limits, the shorter ones miss them too.
        for plan in plans:
            if tried < tries and _may_win(plan, best, goal) and not consider(plan):
                break
    going = True
    while going and tried < tries:
        going = False
        for plan in single(best.plan, able):
            if tried >= tries:
                break
            if consider(plan):
                going = True
                break
    return replace(best, tried=tried)


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
        shorter = min(filter(_runs, single(best, able)), key=_length, default=best)
        if shorter.duration_s >= best.duration_s:
            break
        best = shorter
    return best


def _length(plan: Plan) -> float:
    return plan.duration_s


def _runs(plan: Plan) -> bool:
    """Whether the acceleration suffices for all turns."""
    try:
        for number, turn in enumerate(plan.turns, start=1):
            ramp_length(turn, plan.acceleration_rad_s2, number)
    except DataError:
        return False
    return True


def _check_numbers(goal: Goal) -> None:
    """Refuse times and limits that are not above 0."""
    if goal.minutes is not None and not goal.minutes > 0.0:
        raise DataError(f"minutes={goal.minutes:g}: a plan takes more than 0 minutes")
    wrong = [f"{effect} {limit:g}" for effect, limit in goal.limits.items() if not limit > 0.0]
    if wrong:
        raise DataError(f"limits of the sigmas: expected numbers above 0, not {wrong[0]}")


def _check_limits(goal: Goal, first: Bounds) -> None:
    unknown = sorted(goal.limits.keys() - first.largest().keys())
    if unknown:
        there = ", ".join(first.largest())
        raise DataError(f"limit for '{unknown[0]}': not an effect of the model (there are: {there})")


def _worst(told: Bounds, goal: Goal) -> float:
    if not goal.limits:
        return told.spread
    largest = told.largest()
    return max(largest[effect] / limit for effect, limit in goal.limits.items())


def _may_win(plan: Plan, best: Found, goal: Goal) -> bool:
    """Whether a plan could be better, by its length alone."""
    minutes = plan.duration_s / 60.0
    if goal.minutes is not None:
        return minutes <= max(goal.minutes, best.minutes) + _SLACK
    return best.worst > 1.0 + _SLACK or minutes < best.minutes - _WORTH_MIN


def _better(new: Found, old: Found, goal: Goal) -> bool:
    if goal.minutes is not None:
        over_new, over_old = (max(0.0, f.minutes - goal.minutes) for f in (new, old))
        if over_new > _SLACK or over_old > _SLACK:
            return over_new < over_old - _SLACK
        return new.worst < old.worst * (1.0 - _WORTH_SHARE)
    if new.worst > 1.0 + _SLACK or old.worst > 1.0 + _SLACK:
        return new.worst < max(1.0, old.worst * (1.0 - _WORTH_SHARE)) + _SLACK
    return new.minutes < old.minutes - _WORTH_MIN


def _key(plan: Plan) -> tuple[object, ...]:
    return (plan.dwell_s, plan.turns, plan.acceleration_rad_s2)
