"""Where a move is, by joint states alone: a real controller says nothing on its topic interface."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np
from sensor_msgs.msg import JointState

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.table import Move
from sdimu_calibration.nodes.credits import NS, to_ns

BEGIN_S = 10.0
"""Time of the joint states (s) within which a table must have begun to move: else its controller has refused."""
OVERDUE_S = 10.0
"""Time (s) by which a turn may be late before a table at rest elsewhere has failed."""


@dataclass(frozen=True)
class Seen:
    """Joint states in the order of the table's joints."""

    ns: int
    """Stamp."""
    angles: Floats
    rates: Floats
    """`angles`, `rates`: rad, rad/s, shape (3,)."""
    interval_ns: int
    """Since the joint states before."""

    @classmethod
    def of(cls, message: JointState, joints: tuple[str, ...], before: Seen | None) -> Seen | None:
        """Read a message; None when a joint is missing or a number is not finite."""
        if not set(joints) <= set(message.name) or len(message.position) != len(message.name):
            return None
        at = [list(message.name).index(name) for name in joints]
        ns, angles = to_ns(message.header.stamp), np.asarray(message.position, dtype=np.float64)[at]
        interval = ns - before.ns if before is not None else 0
        if len(message.velocity) == len(message.name):
            rates = np.asarray(message.velocity, dtype=np.float64)[at]
        elif before is not None and interval > 0:
            rates = (angles - before.angles) * (NS / interval)
        else:
            rates = np.zeros(len(joints))
        return cls(ns, angles, rates, interval) if np.isfinite(angles).all() and np.isfinite(rates).all() else None


class Outcome(Enum):
    """What joint states say of a move."""

    MOVING = "moving"
    DWELLING = "dwelling"
    OVER = "over"


class MoveProgress:
    """Follows one move.

    Parameters
    ----------
    seen : Seen
        The joint states before it was sent.
    tolerance_rad, rest_rad_s : float
        What counts as being there and as rest (rad, rad/s).
    """

    def __init__(self, goal: str, move: Move, seen: Seen, tolerance_rad: float, rest_rad_s: float) -> None:
        self.goal, self.move = goal, move
        self.start_ns, self.arrived_ns, self.reason = seen.ns, 0, ""
        self._start, self._target = seen.angles, np.asarray(move.target)
        self._tolerance_rad, self._rest_rad_s = tolerance_rad, rest_rad_s
        self._begun, self._held = move.turn_s == 0.0, False
        self._interval_ns = 0

    def take(self, seen: Seen) -> Outcome:
        """Take the next joint states; `reason` says why a move that is over has failed."""
        self._interval_ns = max(self._interval_ns, seen.interval_ns)
        there = bool(np.abs(seen.angles - self._target).max() < self._tolerance_rad)
        at_rest = bool(np.abs(seen.rates).max() < self._rest_rad_s)
        self._begun = self._begun or not at_rest or bool(np.abs(seen.angles - self._start).max() > self._tolerance_rad)
        if not self.arrived_ns:
            # A turn that takes its target in passing has not arrived.
            if not (there and at_rest and self._begun):
                return self._late(seen, at_rest)
            self.arrived_ns = seen.ns
        # As long as it was planned; and the dwell as asked for, but for the messages between which the table arrived.
        planned = self.start_ns + round(self.move.duration_s * NS)
        dwelt = self.arrived_ns + round(self.move.step.dwell_s * NS) - 2 * self._interval_ns
        return Outcome.OVER if seen.ns >= max(planned, dwelt) else Outcome.DWELLING

    def told(self, state: str, text: str) -> str:
        """Take what the simulated table says of the goal; the reason when it is over."""
        self._held = state == "held"
        return text if state in ("refused", "replaced", "stopped") else ""

    def _late(self, seen: Seen, at_rest: bool) -> Outcome:
        waited = (seen.ns - self.start_ns) / NS
        words = self.move.step.words
        if not self._begun and waited > BEGIN_S:
            self.reason = f"{words}: the table has not begun to move (has its controller refused the trajectory?)"
        elif at_rest and not self._held and waited > self.move.turn_s + OVERDUE_S:
            degrees = ", ".join(f"{math.degrees(a):.4g}" for a in seen.angles)
            self.reason = f"{words}: the table rests at {degrees} deg instead of its target"
        return Outcome.OVER if self.reason else Outcome.MOVING
