"""The side of the simulated table that takes goals: its topic, its services, and what it says of each goal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from rate_table_sim.core.goal import Goal, GoalPoint
from rate_table_sim.core.programme import GoalProgramme
from rate_table_sim.core.specification import TableSpecification
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.nodes.credits import HISTORY, NS, header, publish, to_ns
from sdimu_calibration.nodes.trajectory_messages import duration_ns, numbers


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


_LEVELS = {"refused": DiagnosticStatus.WARN, "stopped": DiagnosticStatus.WARN, "held": DiagnosticStatus.WARN}


class GoalServer:
    """Takes trajectories and the services hold, resume, stop and finish.

    Parameters
    ----------
    start_ns : int
        Stamp at which the table's time begins.
    allow_partial : bool
        Take trajectories that leave joints out.
    """

    def __init__(
        self, node: Node, programme: GoalProgramme, table: TableSpecification, start_ns: int, *, allow_partial: bool
    ) -> None:
        self._node, self._programme, self._table = node, programme, table
        self._start_ns, self._partial = start_ns, allow_partial
        self._status = node.create_publisher(DiagnosticArray, "rate_table/goal_status", HISTORY)
        # Depth as the controller's: a trajectory is a command, the newest counts.
        node.create_subscription(JointTrajectory, "rate_table/joint_trajectory", self._take, 10)
        for name, action in (
            ("hold", self._hold),
            ("resume", self._resume),
            ("stop", self._stop),
            ("finish", self._finish),
        ):
            node.create_service(Trigger, f"~/{name}", action)

    def sent(self) -> None:
        """Say that a goal was reached when its last sample has been sent."""
        goal = self._programme.reached()
        if goal is not None:
            self._say("reached", goal.name, "the table is at rest on the last point")

    def _take(self, message: JointTrajectory) -> None:
        name = message.header.frame_id
        if not message.points:
            forgotten = self._programme.stop()
            self._programme.resume()
            self._say("stopped", forgotten.name if forgotten else name, "stopped by a trajectory without points")
            return
        try:
            goal = goal_of(
                message, self._table.axis_names, self._programme.end_angle, self._start_ns, allow_partial=self._partial
            )
            replaced = self._programme.take(goal)
        except DataError as error:
            self._say("refused", name, str(error))
            return
        if replaced is not None:
            self._say("replaced", replaced.name, f"replaced by {name or 'another goal'}")
        self._say("accepted", name, f"to {goal.points[-1].time_s:.6g} s after its start")

    def _hold(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        goal = self._programme.goal
        moved = self._programme.hold()
        response.success, response.message = True, "the table comes to rest" if moved else "the table was at rest"
        if goal is not None:
            self._say("held", goal.name, "held; the service resume goes on")
        return response

    def _resume(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        goal = self._programme.resume()
        response.success, response.message = True, f"goes on with {goal.name}" if goal else "ready for goals"
        if goal is not None:
            self._say("resumed", goal.name, "goes on from rest")
        return response

    def _stop(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        goal = self._programme.stop()
        response.success, response.message = True, "stopped; no goal is taken until resume"
        self._say("stopped", goal.name if goal else "", "stopped; no goal is taken until resume")
        return response

    def _finish(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._programme.finish()
        response.success, response.message = True, "the test ends with what is under way"
        return response

    def _say(self, state: str, goal: str, text: str) -> None:
        level = _LEVELS.get(state, DiagnosticStatus.OK)
        status = DiagnosticStatus(level=level, name="rate_table: goal", message=text, hardware_id="rate_table")
        status.values = [KeyValue(key="state", value=state), KeyValue(key="goal", value=goal)]
        stamp = self._start_ns + round(self._programme.now_s * NS)
        publish(self._status, DiagnosticArray(header=header(stamp), status=[status]))
        line = f"goal {goal or 'without a name'} {state}: {text}"
        # The severity belongs to the place of the call.
        if level == DiagnosticStatus.OK:
            self._node.get_logger().info(line)
        else:
            self._node.get_logger().warning(line)
