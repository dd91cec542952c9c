"""A test that chooses its next turn by what it knows so far: what a move would bring, and which one brings most."""

from sdimu_calibration.core.adaptive.choice import Choice, Menu, choose
from sdimu_calibration.core.adaptive.goals import Goals
from sdimu_calibration.core.adaptive.knowledge import Knowledge, OpenClass, knowledge
from sdimu_calibration.core.adaptive.so_far import Ahead, SoFar, ahead, so_far

__all__ = [
    "Ahead", "Choice", "Goals", "Knowledge", "Menu", "OpenClass", "SoFar", "ahead", "choose", "knowledge", "so_far",
]  # fmt: skip
