"""Search a set with and without an unknown function of the attitude, and say what comes back of what is left.

The search itself asks for a function as soon as one is likely. At its end one is asked for here where it is possible,
or where what is left may come back with the attitude. One that turns out not to be likely is left out again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from sdimu_calibration.core.diagnosis.grades import NAMED
from sdimu_calibration.core.joint.function_fit import with_function
from sdimu_calibration.core.joint.leftovers import ATTITUDE, StopError, leftovers
from sdimu_calibration.core.joint.member import Member
from sdimu_calibration.core.joint.near_equations import asks_for_equations, near_equations
from sdimu_calibration.core.joint.recurrence import Recurrence, recurrence
from sdimu_calibration.core.joint.set_fit import SetFit
from sdimu_calibration.core.joint.set_found import FunctionShare, SetSearch, following
from sdimu_calibration.core.joint.set_search import SetRequest, search_about, search_set, search_without


@dataclass(frozen=True)
class Searched:
    """What a set shows."""

    found: SetSearch
    """Beside a function of the attitude where one is likely, of all recordings or of one."""
    without: SetSearch | None
    """Before a function was asked for, where `found` stands beside one; None where no search ended without it."""
    again: Recurrence | None
    """What comes back of what is left without a function; None where nothing is left."""
    functions: tuple[FunctionShare, ...]
    """How probable a function is in all recordings, then in each alone; empty where none was weighed to the end."""
    where: tuple[StopError, ...] = ()
    """What is left in each stop without a function."""

    @property
    def beside_function(self) -> bool:
        """Whether some function of the attitude is likely."""
        return self.found.after.function is not None


def searched(members: Sequence[Member], request: SetRequest, fitted: SetFit | None = None) -> Searched:
    """Search a set, with equations where what is found asks for them; parameters as for `search_set`."""
    done = _without_equations(members, request, fitted)
    if not asks_for_equations(done.found):
        return done
    request.progress("equations", 0.8)
    near = near_equations(done.found, request.run)
    if not near:
        return done
    wider = replace(request, extra=(*request.extra, *near))
    found = search_about(done.found, done.found.after, wider)
    if not any(c.family == "own" for c in found.chosen):
        return done
    if found.after.function is not None and not found.function_is_likely:
        found = search_without(found, wider)
    left = leftovers(found.alone, request.run, found.before.names)
    return Searched(found, None, recurrence(left), (), left.where)


def _without_equations(members: Sequence[Member], request: SetRequest, fitted: SetFit | None) -> Searched:
    found = search_set(members, request, fitted)
    beside = found if found.after.function is not None else None
    if beside is not None and not beside.function_is_likely:
        found = search_without(beside, request)
    left = leftovers(found.alone, request.run, found.before.names)
    again = recurrence(left)
    if beside is None and again is not None:
        # Some recording may have an error that follows the attitude, or what is left may come back with it.
        returns = again.sensors if again.may_come_back(ATTITUDE) else ()
        fit = with_function(found.after, following(found.posterior, NAMED) or returns, request.run)
        beside = search_about(found, fit, request, asks=True) if fit.function else None
    if beside is None:
        return Searched(found, None, again, (), left.where)
    functions = beside.functions if beside.stood else ()
    again = None if again is None else _judged(again, beside)
    if not beside.function_is_likely:
        return Searched(found, None, again, functions, left.where)
    return Searched(beside, None if beside is found else found, again, functions, left.where)


def _judged(again: Recurrence, beside: SetSearch) -> Recurrence:
    """Take the probability of the attitude from all rows, in the place of that which stops tell."""
    common = beside.functions[0]
    # Where kinds look the same, rows that tell of the attitude say nothing of the others.
    if again.apart and beside.stood:
        again = again.judged(ATTITUDE, common.probability)
    return replace(again, sensors=common.sensors) if beside.function_is_likely and common.likely else again
