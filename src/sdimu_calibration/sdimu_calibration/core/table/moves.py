"""The move that makes one step of a plan: a turn at its mean rate within the table's limits, then a dwell.

A turn of angle A in the time T with ramps t_r at acceleration a has the area ``A = a t_r (T - t_r)``; the smaller root
t_r, rounded up to the grid, keeps T and lowers the acceleration. Its waypoints are the corners of the trapezoid with
their rates: the cubic that a trajectory controller lays through two of them is the motion itself, because the angle is
a polynomial of second order between corners. The simulated table has ramps of its own (rate_table_sim.core.profile):
what it does must not follow from what it is asked for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.table.description import AxisLimits, RateTable
from sdimu_calibration.core.table.gimbals import assign_turns, axes_along

_ALONG_RAD = math.radians(0.5)
"""Angle (rad) from parallel up to which a gimbal axis turns about a platform axis: encoders, levelling."""
_ON_GRID = 1e-6
"""A time this close to the grid (in steps) is on it (1): decimal fractions are not exact in binary."""


@dataclass(frozen=True)
class Step:
    """A turn and the dwell after it."""

    turn: Turn | None
    """Its axis is a platform axis (``X``, ``Y``, ``Z``) or the name of a joint; None only dwells."""
    dwell_s: float
    """Rest after the turn (s)."""
    acceleration_rad_s2: float | None = None
    """Largest acceleration of the turn (rad/s^2); the limit of the axis when None."""

    @property
    def words(self) -> str:
        """In words, such as ``X +90 deg at 10 deg/s, then dwell 60 s``."""
        if self.turn is None:
            return f"dwell {self.dwell_s:g} s"
        angle, rate = math.degrees(self.turn.angle_rad), math.degrees(self.turn.rate_rad_s)
        return f"{self.turn.axis} {angle:+.6g} deg at {rate:.6g} deg/s, then dwell {self.dwell_s:g} s"


@dataclass(frozen=True)
class Waypoint:
    """A point of a trajectory."""

    time_s: float
    """From the start of the move (s)."""
    angles: tuple[float, ...]
    rates: tuple[float, ...]
    """`angles`, `rates`: one for each joint (rad, rad/s)."""


@dataclass(frozen=True)
class Move:
    """What is sent to the table for one step."""

    step: Step
    joint: str
    """The joint that turns; empty when none does."""
    axis: tuple[int, float] | None
    """Its index and the sense in which it turns, as `plan_move` takes them."""
    waypoints: tuple[Waypoint, ...]
    """At least one; times ascend, the last is the end of the dwell."""
    turn_s: float
    """Length of the turn (s)."""

    @property
    def target(self) -> tuple[float, ...]:
        """Angles at the end (rad)."""
        return self.waypoints[-1].angles

    @property
    def duration_s(self) -> float:
        """Length of turn and dwell (s)."""
        return self.waypoints[-1].time_s


def plan_move(table: RateTable, angles: Floats, step: Step, axis: tuple[int, float] | None = None) -> Move:
    """Make the move of a step.

    Parameters
    ----------
    angles : ndarray, shape (3,)
        Where the joints are now (rad, counted through all turns).
    axis : (int, float), optional
        Joint and sense that make the turn, as `assign_turns` gives them; chosen when left out: the innermost that stays
        within its limits.
    """
    here = np.asarray(angles, dtype=np.float64)
    if not (math.isfinite(step.dwell_s) and step.dwell_s >= 0.0):
        raise DataError(f"{step.words}: the dwell must be 0 s or longer")
    if step.turn is None or step.turn.angle_rad == 0.0:
        if step.dwell_s <= 0.0:
            raise DataError(f"{step.words}: nothing to do (state a turn or a dwell)")
        return Move(step, "", None, (Waypoint(step.dwell_s, tuple(here.tolist()), (0.0, 0.0, 0.0)),), 0.0)
    reasons = []
    for k, sign in [axis] if axis else reversed(_joints(table, here, step)):
        corners, reason = _corners(table.limits[k], step, sign, float(here[k]), table.sample_rate_hz)
        if not reason:
            return _move(table, here, step, (k, sign), corners)
        reasons.append(f"{table.joints[k]}: {reason}")
    raise DataError(f"{step.words}: {'; '.join(reasons)}")


def is_possible(table: RateTable, angles: Floats, *steps: Step) -> bool:
    """Whether steps are possible, one after the other, from where the table stands.

    Parameters
    ----------
    angles : ndarray, shape (3,)
        Where the joints are (rad).
    """
    try:
        for step in steps:
            angles = np.asarray(plan_move(table, angles, step).target)
    except DataError:
        return False
    return True


def steps_of(plan: Plan) -> tuple[Step, ...]:
    """Take a plan apart into steps: the first only dwells. Gives one more than the plan has turns."""
    turns: tuple[Turn | None, ...] = (None, *plan.turns)
    return tuple(Step(turn, dwell, plan.acceleration_rad_s2) for turn, dwell in zip(turns, plan.dwell_s, strict=True))


def moves_of(table: RateTable, angles: Floats, plan: Plan) -> tuple[Move, ...]:
    """Make the moves of a whole plan, with the joints chosen so that every later turn is possible.

    Parameters
    ----------
    angles : ndarray, shape (3,)
        Where the joints are at the start (rad).
    """
    here = np.asarray(angles, dtype=np.float64)
    axes: tuple[tuple[int, float] | None, ...] = (None,) * len(plan.dwell_s)
    if table.axes is not None:
        first, middle, last = (limits.reach_rad for limits in table.limits)
        axes = (None, *assign_turns(plan, table.axes, here, (first, middle, last), _ALONG_RAD))
    moves = []
    for step, axis in zip(steps_of(plan), axes, strict=True):
        moves.append(plan_move(table, here, step, axis))
        here = np.asarray(moves[-1].target)
    return tuple(moves)


def _joints(table: RateTable, angles: Floats, step: Step) -> list[tuple[int, float]]:
    """Joints that turn about the axis of a step, with sense; the innermost is last."""
    assert step.turn is not None
    axis = step.turn.axis
    if axis in table.joints:
        return [(table.joints.index(axis), 1.0)]
    if axis not in ("X", "Y", "Z"):
        raise DataError(f"{step.words}: no axis or joint '{axis}' (there are: X, Y, Z, {', '.join(table.joints)})")
    if table.axes is None:
        return [("XYZ".index(axis), 1.0)]
    found = axes_along(axis, angles, table.axes, _ALONG_RAD)
    if not found:
        at = ", ".join(f"{name} {math.degrees(a):g}" for name, a in zip(table.joints, angles, strict=True))
        raise DataError(f"{step.words}: no gimbal axis is along {axis} at {at} deg")
    return found


def _corners(
    limits: AxisLimits, step: Step, sign: float, start_rad: float, grid_hz: float
) -> tuple[list[tuple[float, float, float]], str]:
    """Time, angle turned and rate at the corners after the start, or the reason why the axis cannot do it."""
    assert step.turn is not None
    angle, rate = sign * step.turn.angle_rad, step.turn.rate_rad_s
    if not (math.isfinite(rate) and rate > 0.0 and math.isfinite(angle)):
        return [], "the rate must be above 0 deg/s and the angle finite"
    why_not = limits.why_not(start_rad + angle)
    if why_not:
        return [], f"{math.degrees(start_rad + angle):.6g} deg is {why_not}"
    most = min(limits.acceleration_rad_s2, step.acceleration_rad_s2 or math.inf)
    size = abs(angle)
    steps = math.ceil(size / rate * grid_hz - _ON_GRID)
    length = steps / grid_hz
    root = length**2 - 4.0 * size / most
    # (T - sqrt(T^2 - 4A/a)) / 2 without the cancellation for gentle turns.
    ramp = 2.0 * size / most / (length + math.sqrt(root)) if root >= 0.0 else math.inf
    ramp_steps = max(1, math.ceil(ramp * grid_hz - _ON_GRID)) if math.isfinite(ramp) else steps
    if 2 * ramp_steps > steps:
        return [], (
            f"a mean of {math.degrees(rate):.6g} deg/s over {math.degrees(size):.6g} deg needs more than the limit of "
            f"{math.degrees(most):.6g} deg/s^2 (lower the rate)"
        )
    peak = angle * grid_hz / (steps - ramp_steps)
    if abs(peak) > limits.rate_rad_s * (1.0 + 1e-9):
        return [], (
            f"{math.degrees(abs(peak)):.6g} deg/s between the ramps is above the limit of "
            f"{math.degrees(limits.rate_rad_s):.6g} deg/s"
        )
    up, turned = ramp_steps / grid_hz, 0.5 * peak * ramp_steps / grid_hz
    corners = [(up, turned, peak), (length - up, angle - turned, peak), (length, angle, 0.0)]
    return (corners if 2 * ramp_steps < steps else [corners[0], corners[2]]), ""


def _move(
    table: RateTable, here: Floats, step: Step, axis: tuple[int, float], corners: list[tuple[float, float, float]]
) -> Move:
    k, turn_s = axis[0], corners[-1][0]
    if step.dwell_s > 0.0:
        corners = [*corners, (turn_s + step.dwell_s, corners[-1][1], 0.0)]
    waypoints = []
    for time_s, turned, rate in corners:
        angles, rates = here.copy(), np.zeros(3)
        angles[k] += turned
        rates[k] = rate
        waypoints.append(Waypoint(time_s, tuple(angles.tolist()), tuple(rates.tolist())))
    return Move(step, table.joints[k], axis, tuple(waypoints), turn_s)
