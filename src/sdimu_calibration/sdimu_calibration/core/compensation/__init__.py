"""The result in use: errors taken out of samples, and the part of them that matrices can hold.

A package of its own so that a change here compiles none of the loops of the estimator again.
"""

from sdimu_calibration.core.compensation.compensator import (
    Compensated,
    Compensator,
    compensate,
    compensate_recording,
    compensator,
    heat_since,
    resolved,
)
from sdimu_calibration.core.compensation.linear import Factor, LinearModel, Part, linear_model

__all__ = [
    "Compensated",
    "Compensator",
    "Factor",
    "LinearModel",
    "Part",
    "compensate",
    "compensate_recording",
    "compensator",
    "heat_since",
    "linear_model",
    "resolved",
]
