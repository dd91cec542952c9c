"""What an adaptive test has to reach: the largest sigma of each effect's coefficients, in the time there is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.effects import body_frame
from sdimu_calibration.core.plan_search.next_turn import named_class
from sdimu_calibration.core.recording import DataError


@dataclass(frozen=True)
class Goals:
    """Limits of a test."""

    name: str
    limits: Mapping[str, float]
    """Largest sigma allowed, by effect (SI)."""
    minutes: float
    """Time there is (min)."""
    both_senses: bool = True
    """A limit of a gyro's scale factor holds only where an asymmetry that the test has not shown, of the size that
    physics gives it, cannot hide more: turns about each axis in both senses."""
    tell: tuple[str, ...] = ()
    """Coefficients or effects: the first is to be told from the others, each of the size that physics gives it."""

    def of(self, names: Sequence[str], frame: str) -> tuple[Bools, Floats]:
        """Find the coefficients that have a limit.

        Parameters
        ----------
        names : sequence of str, length p
        frame : str
            Body frame of the report; what it makes zero needs no limit.

        Returns
        -------
        limited : ndarray of bool, shape (p,)
        limit : ndarray, shape (limited,)
            SI.
        """
        pinned = body_frame.pinned_in(names, frame)
        limit = np.array([np.nan if n in pinned else self.limits.get(_effect(n), np.nan) for n in names])
        limited = np.isfinite(limit)
        if not limited.any():
            there = ", ".join(self.limits)
            raise DataError(f"goals '{self.name}': the model has no coefficient with a limit (limits: {there})")
        return limited, limit[limited]


def aimed(goals: Goals, tell: Sequence[str]) -> Goals:
    """Let goals ask to tell coefficients apart, too; by none they stay as they are. `tell`: as of `Goals`."""
    if tell:
        named_class(tell)
    return replace(goals, tell=tuple(tell))


def _effect(coefficient: str) -> str:
    return coefficient.rpartition("_")[0]
