"""A trajectory_msgs/JointTrajectory as a goal of the table, after the rules of ros2_control's controller."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from rate_table_sim.core.goal import Goal, GoalPoint
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.nodes.credits import NS, to_ns
from sdimu_calibration.nodes.trajectory_messages import duration_ns, numbers

Floats = NDArray[np.float64]


def goal_of(
    message: JointTrajectory, names: Sequence[str], here: Floats, start_ns: int, *, allow_partial: bool
) -> Goal:
    """Read a trajectory.

    Parameters
    ----------
    names : sequence of str
        Joints of the table.
    here : ndarray, shape (3,)
        Where joints that the message leaves out stay (rad).
    start_ns : int
        Stamp at which the table's time began.
    allow_partial : bool
        Take a trajectory that leaves joints out.
    """
    given = list(message.joint_names)
    if not given:
        raise DataError(f"joint_names is empty (expected {', '.join(names)})")
    if unknown := [name for name in given if name not in names]:
        raise DataError(f"no joint '{unknown[0]}' (there are: {', '.join(names)})")
    if len(set(given)) < len(given):
        raise DataError("joint_names names a joint twice")
    missing = [name for name in names if name not in given]
    if missing and not allow_partial:
        raise DataError(f"joint '{missing[0]}' is missing (set allow_partial_goals to leave joints out)")
    at = [list(names).index(name) for name in given]
    points = tuple(_point(point, k, at, here) for k, point in enumerate(message.points))
    stamp = to_ns(message.header.stamp)
    return Goal(message.header.frame_id, (stamp - start_ns) / NS if stamp else None, points)


def _point(point: JointTrajectoryPoint, number: int, at: Sequence[int], here: Floats) -> GoalPoint:
    if len(point.effort):
        raise DataError(f"point {number}: effort is nothing that a rate table follows (leave it empty)")
    fields = (point.positions, point.velocities, point.accelerations)
    for name, values in zip(("positions", "velocities", "accelerations"), fields, strict=True):
        if len(values) not in ((len(at),) if name == "positions" else (0, len(at))):
            raise DataError(f"point {number}: {len(values)} {name} for {len(at)} joints")
    if len(point.accelerations) and not len(point.velocities):
        raise DataError(f"point {number}: accelerations without velocities")
    angle, rate, acceleration = (
        _in_order(values, at, base) for values, base in zip(fields, (here, np.zeros(3), np.zeros(3)), strict=True)
    )
    assert angle is not None
    return GoalPoint(duration_ns(point) / NS, angle, rate, acceleration)


def _in_order(values: Sequence[float], at: Sequence[int], base: Floats) -> Floats | None:
    if not len(values):
        return None
    whole = base.astype(np.float64, copy=True)
    whole[list(at)] = numbers(values)
    return whole
