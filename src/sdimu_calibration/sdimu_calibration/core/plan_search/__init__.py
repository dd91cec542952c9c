"""Search for a shorter or more informative plan, and for the turn that separates effects. SI units.

A package of its own so that a change here compiles none of the loops of the estimator again.
"""

from sdimu_calibration.core.evidence.known import Known, known_of
from sdimu_calibration.core.plan_search.bound import Bounds, Question
from sdimu_calibration.core.plan_search.known import gain
from sdimu_calibration.core.plan_search.next_turn import NextTurn, next_turn, untold
from sdimu_calibration.core.plan_search.search import Found, Goal, search

__all__ = [
    "Bounds",
    "Found",
    "Goal",
    "Known",
    "NextTurn",
    "Question",
    "gain",
    "known_of",
    "next_turn",
    "search",
    "untold",
]
