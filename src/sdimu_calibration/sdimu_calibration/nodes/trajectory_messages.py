"""Moves as trajectory_msgs/JointTrajectory, and back."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from builtin_interfaces.msg import Duration
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.table import Move, RateTable
from sdimu_calibration.nodes.credits import NS, header
from sdimu_calibration.nodes.table_progress import Seen


def trajectory(table: RateTable, move: Move, goal: str) -> JointTrajectory:
    """Return a move as a trajectory that begins when it arrives (stamp 0).

    The name of the goal is the frame_id: a controller ignores it, the simulated table answers with it.
    """
    points = [_point(p.time_s, p.angles, p.rates) for p in move.waypoints]
    return JointTrajectory(header=header(0, goal), joint_names=list(table.joints), points=points)


def braking(table: RateTable, seen: Seen, goal: str) -> JointTrajectory:
    """Return the trajectory that brings a table to rest from where it is, each joint within its limits.

    A point is used, and no empty trajectory: ROS 2's controller refuses that. The table is further on than its joint
    states; a quarter of the largest deceleration leaves room for that. Where the stops or the cable are nearer, the
    joint that turns rests there, by as much more deceleration as that takes: never more than the last ramp of a move.
    """
    most = np.array([limits.acceleration_rad_s2 for limits in table.limits])
    reach = np.array([limits.reach_rad for limits in table.limits])
    k = int(np.argmax(np.abs(seen.rates) / most))
    speed, hardest_s = abs(float(seen.rates[k])), abs(float(seen.rates[k])) / most[k]
    room = max(float(reach[k] - np.sign(seen.rates[k]) * seen.angles[k]), 0.0)
    time_s = max(4.0 * hardest_s, 1.0)
    if 0.5 * speed * time_s > room:
        time_s = max(2.0 * room / speed, hardest_s, 1.0 / table.sample_rate_hz)
    # At constant deceleration over the same time for all joints; encoders' noise may read beyond a stop.
    angles = np.clip(seen.angles + 0.5 * seen.rates * time_s, -reach, reach)
    points = [_point(time_s, angles.tolist(), [0.0] * len(table.joints))]
    return JointTrajectory(header=header(0, goal), joint_names=list(table.joints), points=points)


def duration_ns(point: JointTrajectoryPoint) -> int:
    """Return time_from_start (ns)."""
    return int(point.time_from_start.sec) * NS + int(point.time_from_start.nanosec)


def numbers(values: Sequence[float]) -> Floats:
    """Return a field of a point as an array."""
    return np.asarray(values, dtype=np.float64)


def _point(time_s: float, angles: Sequence[float], rates: Sequence[float]) -> JointTrajectoryPoint:
    sec, nanosec = divmod(round(time_s * NS), NS)
    time_from_start = Duration(sec=sec, nanosec=nanosec)
    return JointTrajectoryPoint(positions=list(angles), velocities=list(rates), time_from_start=time_from_start)
