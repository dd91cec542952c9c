"""Plans before they are run: a shorter or more telling one, and the turn that tells effects apart.

A package of its own so that a change here compiles none of the loops of the estimator again.
"""

from sdimu_calibration.core.plan_search.bound import Bounds, Question
from sdimu_calibration.core.plan_search.next_turn import NextTurn, next_turn
from sdimu_calibration.core.plan_search.search import Found, Goal, search

__all__ = ["Bounds", "Found", "Goal", "NextTurn", "Question", "next_turn", "search"]
