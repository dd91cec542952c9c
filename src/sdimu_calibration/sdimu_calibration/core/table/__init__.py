"""A rate table as the one who drives it sees it: its axes and limits, and the moves that make a turn of a plan."""

from sdimu_calibration.core.table.description import AxisLimits, RateTable
from sdimu_calibration.core.table.gimbals import assign_turns, axes_along
from sdimu_calibration.core.table.moves import Move, Step, Waypoint, is_possible, moves_of, plan_move, steps_of

__all__ = [
    "AxisLimits",
    "Move",
    "RateTable",
    "Step",
    "Waypoint",
    "assign_turns",
    "axes_along",
    "is_possible",
    "moves_of",
    "plan_move",
    "steps_of",
]
