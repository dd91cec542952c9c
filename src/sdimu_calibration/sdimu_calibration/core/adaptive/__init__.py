"""A test that chooses its next turn by what it knows so far: what a move would bring, and which one brings most."""

from sdimu_calibration.core.adaptive.choice import FIRST_STOP_S, Choice, End, choose
from sdimu_calibration.core.adaptive.goals import Goals, aimed
from sdimu_calibration.core.adaptive.knowledge import Knowledge, fitted, knowledge, nearest_other
from sdimu_calibration.core.adaptive.menu import Menu
from sdimu_calibration.core.adaptive.open_class import OpenClass
from sdimu_calibration.core.adaptive.so_far import Ahead, SoFar, ahead, so_far

__all__ = [
    "FIRST_STOP_S",
    "Ahead",
    "Choice",
    "End",
    "Goals",
    "Knowledge",
    "Menu",
    "OpenClass",
    "SoFar",
    "ahead",
    "aimed",
    "choose",
    "fitted",
    "knowledge",
    "nearest_other",
    "so_far",
]
