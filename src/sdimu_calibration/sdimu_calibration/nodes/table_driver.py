"""A library for nodes that drive a rate table by trajectories, as ros2_control's joint_trajectory_controller takes.

    driver = TableDriver(node, ticker, load_rate_table("ideal"))
    future = driver.move(Step(Turn("X", math.radians(90.0), math.radians(10.0)), dwell_s=60.0), why="tells ...")
    ...                                             # spin; future.result() is an Arrival
    arrival.ok, arrival.reason, arrival.arrived_ns, arrival.end_ns

The same messages drive the simulated table and a real one: decision 0014 says which, doc/on-my-driver.md how to name
them. Nothing is sent unless the parameter `allow_motion` of the node is true; with `ask`, each move waits for the yes
of a person on the service ``~/confirm``.

Topics (relative, remap them at will): rate_table/joint_trajectory out, rate_table/joint_states in,
rate_table/goal_status in (a real controller has none), rate_table/status out when nobody else publishes it, ``~/moves``
(what was asked, sent, done, and why), ``~/question`` (latched: what `ask` waits for).
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.table import Move, RateTable, Step, plan_move
from sdimu_calibration.nodes.credits import HISTORY, LATCHED, NS, header, publish
from sdimu_calibration.nodes.listening import Listener
from sdimu_calibration.nodes.parameters import Declare
from sdimu_calibration.nodes.table_progress import MoveProgress, Outcome, Seen
from sdimu_calibration.nodes.ticking import Ticker
from sdimu_calibration.nodes.trajectory_messages import braking, trajectory

TRAJECTORY = "rate_table/joint_trajectory"
JOINT_STATES = "rate_table/joint_states"
GOAL_STATUS = "rate_table/goal_status"
STATUS = "rate_table/status"
LISTENER_PATIENCE_S = 5.0
"""Wall time (s) for which a controller is waited for that does not listen yet: discovery takes up to three."""
ACKNOWLEDGED_S = 2.0
"""Longest wall time (s) for which a brake waits until the controller holds it: the node may leave right after."""
SILENCE_S = 120.0
"""Wall time (s) without joint states after which a move has failed; a table in simulation waits for slow consumers."""


@dataclass(frozen=True)
class Arrival:
    """How a move ended."""

    ok: bool
    """The table reached the target and dwelt."""
    reason: str
    """Why not; empty when `ok`."""
    start_ns: int
    arrived_ns: int
    end_ns: int
    """`start_ns`, `arrived_ns`, `end_ns`: stamps of the joint states: before the move, at rest on the target, at the
    end of the dwell."""
    angles: tuple[float, ...]
    """Of the joints at the end (rad)."""


class TableDriver:
    """Drives a table step by step; see the module.

    Parameters
    ----------
    node : rclpy.node.Node
        Gets the parameters `allow_motion`, `ask`, `tolerance_deg`, `rest_deg_s` and the service ``~/confirm``.
    """

    def __init__(self, node: Node, ticker: Ticker, table: RateTable) -> None:
        self._node, self._table = node, table
        self._allowed, self._ask = _declare(node)
        tolerance, rest = (float(node.get_parameter(name).value) for name in ("tolerance_deg", "rest_deg_s"))
        self._tolerance_rad, self._rest_rad_s = math.radians(tolerance), math.radians(rest)
        self._seen: Seen | None = None
        self._commanded: Floats | None = None
        self._move: Move | None = None
        self._future: Future | None = None
        self._why, self._number, self._brake = "", 0, ""
        self._question_open = False
        self._progress: MoveProgress | None = None
        self._waiting_since = 0.0
        self._stop, self._said_ns, self._status = 0, 0, None
        self._heard = time.monotonic()
        self._trajectory = node.create_publisher(JointTrajectory, TRAJECTORY, 10)
        self._moves = node.create_publisher(DiagnosticArray, "~/moves", HISTORY)
        self._question = node.create_publisher(String, "~/question", LATCHED)
        self._confirm = node.create_service(SetBool, "~/confirm", self._answer)
        self._listeners = (
            Listener(node, ticker, JointState, JOINT_STATES, self._take_joints, late=True),
            Listener(node, ticker, DiagnosticArray, GOAL_STATUS, self._take_goal_status),
        )
        node.add_post_set_parameters_callback(self._take_parameters)
        ticker.every(0.05, self._tick)

    @property
    def angles(self) -> Floats | None:
        """Where the joints are commanded to be, shape (3,) (rad); None before the first joint states."""
        if self._seen is None:
            return None
        # The encoders' noise is not commanded back to the table.
        near = self._commanded is not None and np.abs(self._commanded - self._seen.angles).max() < self._tolerance_rad
        return self._commanded if near else self._seen.angles

    @property
    def stamp_ns(self) -> int:
        """Stamp of the newest joint states (ns); 0 before the first."""
        return 0 if self._seen is None else self._seen.ns

    @property
    def busy(self) -> bool:
        """Whether a move is under way."""
        return self._future is not None

    def move(self, step: Step, why: str = "", axis: tuple[int, float] | None = None) -> Future:
        """Carry out a step.

        Parameters
        ----------
        why : str
            The reason of the choice, for log, question and ``~/moves``.
        axis : (int, float), optional
            Joint and sense, as `core.table.assign_turns` gives them.

        Returns
        -------
        rclpy.task.Future
            Its result is an `Arrival`; it never holds an exception.
        """
        future = Future()
        if self._future is not None:
            future.set_result(self._arrival("another move is under way"))
            return future
        self._future, self._why = future, why
        try:
            self._move = self._plan(step, axis)
        except DataError as error:
            self._end(str(error))
            return future
        self._waiting_since = time.monotonic()
        if not self._allowed:
            self._end(f"{step.words}: nothing moves while the parameter allow_motion is false")
        elif self._ask and step.turn is not None:
            self._put_question(step)
        else:
            self._send()
        return future

    def stop(self, reason: str) -> None:
        """Bring the table to rest within its limits and end the move under way."""
        if self._progress is not None and self._seen is not None:
            self._brake = f"{self._progress.goal}/brake"
            # Not by `publish`, which sends nothing after a signal: that is when the brake is needed most.
            self._trajectory.publish(braking(self._table, self._seen, self._brake))
            self._trajectory.wait_for_all_acked(Duration(seconds=ACKNOWLEDGED_S))
        if self._future is not None:
            self._end(reason)

    def _plan(self, step: Step, axis: tuple[int, float] | None = None) -> Move:
        if (angles := self.angles) is None:
            topic = self._node.resolve_topic_name(JOINT_STATES)
            raise DataError(f"{step.words}: {topic}: no angles of {', '.join(self._table.joints)} have come yet")
        return plan_move(self._table, angles, step, axis)

    def _put_question(self, step: Step) -> None:
        why = f" ({self._why})" if self._why else ""
        text = f"{step.words}{why}: move the table? Answer on {self._confirm.srv_name}"
        self._question_open = True
        self._node.get_logger().warning(text)
        self._question.publish(String(data=text))
        self._say("asked", text)

    def _send(self) -> None:
        """Send the move once somebody listens."""
        move, seen = self._move, self._seen
        assert move is not None
        assert seen is not None
        if not self._trajectory.get_subscription_count():
            if time.monotonic() - self._waiting_since > LISTENER_PATIENCE_S:
                topic = self._trajectory.topic_name
                self._end(f"{topic}: no controller listens (is it active, is the topic remapped?)")
            return
        self._number += 1
        goal = f"{self._node.get_fully_qualified_name()}/{self._number}"
        self._progress = MoveProgress(goal, move, seen, self._tolerance_rad, self._rest_rad_s)
        self._heard = time.monotonic()
        self._phase(rotating=move.turn_s > 0.0)
        self._say("sent", f"{move.step.words}{f': {self._why}' if self._why else ''}")
        publish(self._trajectory, trajectory(self._table, move, goal))
        self._commanded = np.asarray(move.target)

    def _take_joints(self, message: JointState) -> None:
        seen = Seen.of(message, self._table.joints, self._seen)
        if seen is None:
            text = f"{JOINT_STATES}: a message without {', '.join(self._table.joints)} is ignored"
            self._node.get_logger().warning(text, once=True)
            return
        if self._seen is not None and seen.ns <= self._seen.ns:
            return
        self._seen, self._heard = seen, time.monotonic()
        progress = self._progress
        arrived = progress is not None and progress.arrived_ns
        if progress is not None and (outcome := progress.take(seen)) is not Outcome.MOVING:
            if not arrived and progress.arrived_ns and progress.move.turn_s > 0.0:
                self._stop += 1
                self._phase(rotating=False)
            if outcome is not Outcome.DWELLING:
                self._end(progress.reason)
        self._repeat_phase()

    def _take_goal_status(self, message: DiagnosticArray) -> None:
        for status in message.status:
            values = {entry.key: entry.value for entry in status.values}
            if self._brake and (values.get("goal"), values.get("state")) == (self._brake, "refused"):
                # A table that speaks, as the simulated one does, also knows the trajectory without points.
                self._brake = ""
                publish(self._trajectory, JointTrajectory())
            if self._progress is not None and values.get("goal") == self._progress.goal:
                reason = self._progress.told(values.get("state", ""), status.message)
                if reason:
                    self._end(reason)
                    return

    def _tick(self) -> None:
        if self._move is not None and self._progress is None and not self._question_open:
            self._send()
        if self._progress is not None and time.monotonic() - self._heard > SILENCE_S:
            self._end(f"{JOINT_STATES}: nothing has come for {SILENCE_S:.0f} s")

    def _answer(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        waiting = self._question_open
        response.success, response.message = waiting, "no move waits for an answer"
        if waiting and self._move is not None:
            response.message = self._move.step.words
        if waiting and request.data:
            # The yes holds while a controller is waited for: `_tick` tries again.
            self._question_open, self._waiting_since = False, time.monotonic()
            self._send()
        elif waiting:
            self._end(f"{response.message}: a person said no")
        return response

    def _take_parameters(self, parameters: Sequence[Parameter]) -> None:
        """Act on parameters that have been set; a question that is open stays open."""
        for parameter in parameters:
            if parameter.name == "allow_motion":
                self._allowed = bool(parameter.value)
                if not self._allowed and self.busy:
                    self.stop("stopped: the parameter allow_motion was set to false")
            if parameter.name == "ask":
                self._ask = bool(parameter.value)
                self._ask_before_it_is_sent()

    def _ask_before_it_is_sent(self) -> None:
        """Ask for a move that still waits for its controller."""
        move = self._move if self._progress is None and not self._question_open else None
        if self._ask and move is not None and move.step.turn is not None:
            self._put_question(move.step)

    def _end(self, reason: str) -> None:
        future, arrival = self._future, self._arrival(reason)
        words = self._move.step.words if self._move is not None else ""
        self._future = self._move = self._progress = None
        self._question_open = False
        self._question.publish(String(data=""))
        self._say("failed" if reason else "done", reason or words)
        if reason:
            self._node.get_logger().error(reason)
        if future is not None:
            future.set_result(arrival)

    def _arrival(self, reason: str) -> Arrival:
        start = self._progress.start_ns if self._progress is not None else self.stamp_ns
        arrived = self._progress.arrived_ns if self._progress is not None else 0
        angles = () if self._seen is None else tuple(self._seen.angles.tolist())
        return Arrival(not reason, reason, start, arrived, self.stamp_ns, angles)

    def _say(self, state: str, text: str) -> None:
        """Publish on ~/moves what became of a move."""
        level = DiagnosticStatus.ERROR if state == "failed" else DiagnosticStatus.OK
        status = DiagnosticStatus(level=level, name="table move", message=text, hardware_id=self._table.name)
        joint = self._move.joint if self._move is not None else ""
        values = {"state": state, "number": str(self._number), "joint": joint, "why": self._why}
        status.values = [KeyValue(key=key, value=value) for key, value in values.items()]
        self._moves.publish(DiagnosticArray(header=header(self.stamp_ns), status=[status]))
        if state == "sent":
            self._node.get_logger().info(text)

    def _phase(self, *, rotating: bool) -> None:
        """Publish the phase, when the table does not do it itself; it holds from the newest joint states on."""
        if self._status is None:
            if self._node.count_publishers(self._node.resolve_topic_name(STATUS)):
                return
            self._status = self._node.create_publisher(DiagnosticArray, STATUS, HISTORY)
        phase = "rotating" if rotating else "dwell"
        values = [KeyValue(key="phase", value=phase), KeyValue(key="stop", value=str(self._stop))]
        status = DiagnosticStatus(name="rate_table", message=phase, hardware_id=self._table.name, values=values)
        publish(self._status, DiagnosticArray(header=header(self.stamp_ns), status=[status]))
        self._said_ns = self.stamp_ns

    def _repeat_phase(self) -> None:
        if self._status is not None and self.stamp_ns - self._said_ns >= NS:
            progress = self._progress
            self._phase(rotating=progress is not None and progress.move.turn_s > 0.0 and not progress.arrived_ns)


def _declare(node: Node) -> tuple[bool, bool]:
    declare = Declare(node)
    allowed = declare.flag("allow_motion", False, "let trajectories be sent; set to false: motion ends", live=True)
    ask = declare.flag("ask", False, "wait for a yes on ~/confirm before each move", live=True)
    declare.number("tolerance_deg", 0.05, "so close to its target a joint has arrived (deg)", least=1e-6, most=5.0)
    declare.number("rest_deg_s", 0.05, "below this rate a joint is at rest (deg/s)", least=1e-6, most=5.0)
    return allowed, ask
