"""A goal of the table: points in time, and the motion of the axes through them.

As ros2_control's joint_trajectory_controller interpolates: the cubic between two points with velocities, the quintic
between two with accelerations. Between points without velocities the axes turn from rest to rest, each by a trapezoid
within its limit of acceleration (the controller would jump from rate to rate there).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rate_table_sim.core.profile import trapezoid
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.plan import Turn
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.table.description import AxisLimits

LONGEST_S = 6.0 * 3600.0
"""Longest goal (s): its samples are made at once, and six hours of them are 250 MB at 100 Hz."""
_ROUNDING = 1e-6
"""Excess over a limit (1) that is rounding of the message or of the interpolation."""
_SAME_RAD = math.radians(0.01)
"""A point at 0 s so close to where the table is (rad) is where the table is."""


@dataclass(frozen=True)
class AxisState:
    """Where the axes are."""

    angle: Floats
    rate: Floats
    """`angle`, `rate`: rad, rad/s, shape (3,)."""


@dataclass(frozen=True)
class GoalPoint:
    """A point of a goal."""

    time_s: float
    """From the start of the goal."""
    angle: Floats
    """rad, shape (3,)."""
    rate: Floats | None = None
    acceleration: Floats | None = None
    """`rate`, `acceleration`: rad/s, rad/s^2, shape (3,)."""


@dataclass(frozen=True)
class Goal:
    """A trajectory, its joints in the order of the table's axes."""

    name: str
    """To answer with."""
    start_s: float | None
    """Time of the table at which it starts; None is now."""
    points: tuple[GoalPoint, ...]


def goal_samples(
    points: Sequence[GoalPoint], at: AxisState, limits: Sequence[AxisLimits], names: Sequence[str], grid_hz: float
) -> tuple[Floats, Floats]:
    """Motion of the axes through the points of a goal.

    Parameters
    ----------
    points : sequence of GoalPoint
        Times count from the state `at`.
    limits : sequence of AxisLimits
        One an axis; every sample of the motion keeps them.
    names : sequence of str
        Of the joints, for messages.
    grid_hz : float
        Samples a second.

    Returns
    -------
    angle, rate : ndarray, shape (n, 3)
        At the samples 1 ... n after `at` (rad, rad/s); the last at or after the last point, at rest.
    """
    kept = _checked(points, at, names)
    parts: list[tuple[Floats, Floats]] = []
    begin_s, state, bend = 0.0, at, None
    done = 0
    for point in kept:
        end = point.time_s if point.rate is not None or state.rate.any() else round(point.time_s * grid_hz) / grid_hz
        last = math.ceil(end * grid_hz - _ROUNDING) if point is kept[-1] else math.floor(end * grid_hz + _ROUNDING)
        t = np.arange(done + 1, last + 1) / grid_hz
        if point.rate is None and not state.rate.any():
            angle, rate, steepest = _rest_to_rest(point, state, limits, names, len(t), grid_hz)
        else:
            angle, rate, steepest = _polynomial(point, state, bend, begin_s, end, t)
        _hold_to_limits(angle, rate, steepest, limits, names, t)
        parts.append((angle, rate))
        state = AxisState(point.angle, np.zeros(3) if point.rate is None else point.rate)
        begin_s, done, bend = end, last, point.acceleration
    angle, rate = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
    if len(angle):
        angle[-1], rate[-1] = state.angle, 0.0
    return angle, rate


def braking_point(at: AxisState, limits: Sequence[AxisLimits], grid_hz: float) -> GoalPoint:
    """Return the point of rest that is reached by constant deceleration within the limits, on the grid."""
    most = np.array([one.acceleration_rad_s2 for one in limits])
    samples = max(1, math.ceil(float(np.max(np.abs(at.rate) / most)) * grid_hz - _ROUNDING))
    time_s = samples / grid_hz
    return GoalPoint(time_s, at.angle + 0.5 * at.rate * time_s, np.zeros(3))


def _checked(points: Sequence[GoalPoint], at: AxisState, names: Sequence[str]) -> list[GoalPoint]:
    """Points after the start; DataError when they are no trajectory."""
    times = [point.time_s for point in points]
    if any(later <= earlier for earlier, later in pairwise(times)):
        raise DataError("time_from_start does not ascend strictly from point to point")
    if times[0] < 0.0 or times[-1] > LONGEST_S:
        raise DataError(f"time_from_start: {times[0]:g} to {times[-1]:g} s (expected 0 s to {LONGEST_S:g} s)")
    for point in points:
        for values in (point.angle, point.rate, point.acceleration):
            if values is not None and not np.isfinite(values).all():
                raise DataError(f"the point at {point.time_s:g} s holds a number that is not finite")
    last = points[-1].rate
    if last is not None and np.abs(last).max() > math.radians(1e-6):
        raise DataError(f"the last point has a velocity of {math.degrees(np.abs(last).max()):g} deg/s (expected 0)")
    if times[0] > 0.0:
        return list(points)
    away = np.abs(points[0].angle - at.angle)
    if away.max() > _SAME_RAD:
        k = int(away.argmax())
        raise DataError(f"the point at 0 s is {math.degrees(away[k]):.4g} deg from where {names[k]} is")
    if len(points) == 1:
        raise DataError("the only point is at 0 s: there is no time to reach it")
    return list(points[1:])


def _polynomial(
    point: GoalPoint, state: AxisState, bend: Floats | None, begin_s: float, end_s: float, t: Floats
) -> tuple[Floats, Floats, Floats]:
    """Angle and rate (n, 3) at the times t, and the largest acceleration (3,) between two points."""
    from scipy.interpolate import BPoly  # noqa: PLC0415 (0.3 s that a table without a trajectory does not need)

    left = [state.angle, state.rate]
    right = [point.angle, np.zeros(3) if point.rate is None else point.rate]
    if point.acceleration is not None:
        left.append(np.zeros(3) if bend is None else bend)
        right.append(point.acceleration)
    curve = BPoly.from_derivatives([begin_s, end_s], [left, right])
    ends = np.array([begin_s, end_s])
    steepest = np.abs(curve(np.concatenate([ends, t]), 2)).max(axis=0)
    angle, rate = np.asarray(curve(t)), np.asarray(curve(t, 1))
    # Rest is rest to the last digit, and so is a point that is on the grid.
    rests = np.all([left[0] == right[0], *(v == 0.0 for v in (*left[1:], *right[1:]))], axis=0)
    angle[:, rests], rate[:, rests], steepest[rests] = point.angle[rests], 0.0, 0.0
    if len(t) and abs(t[-1] - end_s) < _ROUNDING * (t[-1] - begin_s) / len(t):
        angle[-1], rate[-1] = right[0], right[1]
    return angle, rate, np.asarray(steepest)


def _rest_to_rest(
    point: GoalPoint, state: AxisState, limits: Sequence[AxisLimits], names: Sequence[str], samples: int, grid_hz: float
) -> tuple[Floats, Floats, Floats]:
    """Angle and rate (n, 3), and the acceleration of each axis (3,), of turns that take all the time there is."""
    angle, rate = np.tile(state.angle, (samples, 1)), np.zeros((samples, 3))
    steepest = np.zeros(3)
    for k in np.flatnonzero(point.angle != state.angle).tolist():
        size = float(point.angle[k] - state.angle[k])
        if not samples:
            raise DataError(f"{names[k]}: no time to reach the point at {point.time_s:g} s")
        turn = Turn(names[k], size, abs(size) * grid_hz / samples)
        try:
            profile = trapezoid(turn, limits[k].acceleration_rad_s2, grid_hz, 1)
        except DataError as error:
            raise DataError(f"{names[k]}: {str(error).removeprefix('turn 1: ')}") from error
        turned, speed = profile.angle_and_rate()
        angle[:, k], rate[:, k], steepest[k] = state.angle[k] + turned[1:], speed[1:], profile.acceleration
        angle[-1, k] = point.angle[k]
    return angle, rate, steepest


def _hold_to_limits(
    angle: Floats, rate: Floats, steepest: Floats, limits: Sequence[AxisLimits], names: Sequence[str], t: Floats
) -> None:
    """Refuse a stretch of motion that breaks a limit."""
    for k, (one, name) in enumerate(zip(limits, names, strict=True)):
        if steepest[k] > one.acceleration_rad_s2 * (1.0 + _ROUNDING):
            raise DataError(
                f"{name}: {math.degrees(steepest[k]):.6g} deg/s^2 is above the limit of "
                f"{math.degrees(one.acceleration_rad_s2):.6g} deg/s^2"
            )
        if not len(t):
            continue
        fast, far = int(np.abs(rate[:, k]).argmax()), int(np.abs(angle[:, k]).argmax())
        if abs(rate[fast, k]) > one.rate_rad_s * (1.0 + _ROUNDING):
            raise DataError(
                f"{name}: {math.degrees(abs(rate[fast, k])):.6g} deg/s at {t[fast]:.4g} s is above the limit of "
                f"{math.degrees(one.rate_rad_s):.6g} deg/s"
            )
        if reason := one.why_not(float(angle[far, k])):
            raise DataError(f"{name}: {math.degrees(angle[far, k]):.6g} deg at {t[far]:.4g} s is {reason}")
