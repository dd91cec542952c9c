"""Node of the simulated rate table: status, joint states, frames, and its true motion for the simulated IMU.

It plays a plan, or with `follow_goals` the trajectories that come on rate_table/joint_trajectory (decision 0014): it
says on rate_table/goal_status what became of each, plays it to its last point, and then stands still in place and time
until the next. Services then: ~/hold, ~/resume, ~/stop, ~/finish.

Parameters: see ``ros2 param describe``, or `_declare` below. Time is the header stamps; how fast they run is decided by
the credits of the consumers, by `speed` and, without a goal, by `idle_speed`.
"""

from __future__ import annotations

import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from rate_table_sim.core import TableMotion, reported_samples, table_motion
from rate_table_sim.core.programme import GoalProgramme, PlanProgramme, Programme
from rate_table_sim.nodes.goal_server import GoalServer
from rate_table_sim.nodes.motion_message import encode_motion
from rate_table_sim.nodes.table_frames import TableFrames
from rate_table_sim.table_file import load_table
from sdimu_calibration.nodes.credits import HISTORY, NS, Producer, header
from sdimu_calibration.nodes.parameters import Declare
from sdimu_calibration.nodes.spinning import run_node
from sdimu_calibration.nodes.ticking import Ticker
from sdimu_calibration.storage.files.config import load_plan

TICK_S = 0.005
FAST_BLOCK = 50
REAL_TIME_BLOCK_S = 0.02
WINDOW_S = 2.0
PEERS_PATIENCE_S = 5.0
FAREWELL_S = 20.0


class Pace:
    """Times real time, counted from the first question after a restart.

    Parameters
    ----------
    speed : float
        Times real time; 0 sets no pace.
    """

    def __init__(self, speed: float) -> None:
        self._speed = speed
        self._origin: tuple[float, float] | None = None

    @property
    def runs(self) -> bool:
        """Whether there is a pace."""
        return self._speed > 0.0

    def restart(self) -> None:
        """Count anew: time stood still, or ran at another pace."""
        self._origin = None

    def allows(self, until_s: float) -> bool:
        """Whether simulated time may have reached `until_s` (s) now."""
        if not self.runs:
            return True
        if self._origin is None:
            self._origin = (time.monotonic(), until_s)
        began, from_s = self._origin
        return until_s - from_s <= self._speed * (time.monotonic() - began)


class RateTableNode:
    """Plays a plan or follows goals; see the module."""

    def __init__(self) -> None:
        self.node = Node("rate_table")
        self.done = Future()
        declare = Declare(self.node)
        plan = declare.text("plan", "kim18", "plan to play: name in config/plan or path; unused with follow_goals")
        table = load_table(declare.text("table", "ideal", "table: name in config/table or path"))
        seed = declare.integer("seed", 1, "of the encoder noise", least=0)
        speed = declare.number("speed", 0.0, "times real time; 0: as fast as credits allow", least=0.0)
        self._start_ns = declare.integer("start_ns", 1_700_000_000 * NS, "stamp of the start (ns)", least=0)
        self._needed = declare.integer("consumers", 0, "credits on the true motion to wait for at the start", least=0)
        self._peers = (
            declare.integer("status_peers", 0, "subscribers of the status to wait for, at most 5 s", least=0),
            declare.integer("joint_peers", 0, "subscribers of the joint states to wait for, at most 5 s", least=0),
        )
        joint_rate = declare.number("joint_rate_hz", 10.0, "joint states a second", least=0.1, most=1000.0)
        follow = declare.flag("follow_goals", False, "follow trajectories instead of a plan")
        partial = declare.flag("allow_partial_goals", False, "take trajectories that leave joints out")
        idle = declare.number("idle_speed", 0.0, "times real time while there is no goal; 0: time waits", least=0.0)
        self._goals = GoalProgramme(table, seed) if follow else None
        self._programme: Programme = self._goals or PlanProgramme(table_motion(load_plan(plan), table, seed))
        self._every = max(1, round(table.sample_rate_hz / joint_rate))
        self._block = FAST_BLOCK if speed == 0.0 else max(1, round(table.sample_rate_hz * REAL_TIME_BLOCK_S))
        self._pace, self._idle = Pace(speed), Pace(idle)
        self._sent = self._status_ns = 0
        self._before: TableMotion | None = None
        self._born = time.monotonic()
        self._departed: float | None = None
        self._begun = False
        ticker = Ticker(self.node)
        self._true_motion = Producer(
            self.node,
            ticker,
            Float64MultiArray,
            "rate_table/true_motion",
            window_ns=int(WINDOW_S * NS),
            on_credit=self._pump,
        )
        self._status = Producer(self.node, ticker, DiagnosticArray, "rate_table/status", qos=HISTORY)
        self._joints = self.node.create_publisher(JointState, "rate_table/joint_states", HISTORY)
        self._frames = TableFrames(self.node, table)
        self._server = (
            None
            if self._goals is None
            else GoalServer(self.node, self._goals, table, self._start_ns, allow_partial=partial)
        )
        self._timer = self.node.create_timer(TICK_S, self._pump)

    def close(self) -> None:
        """Nothing to leave behind."""

    def _everyone_is_here(self) -> bool:
        if not self._true_motion.heard_by(self._needed):
            return False
        status, joints = self._peers
        matched = (
            self._status.publisher.get_subscription_count() >= status
            and self._joints.get_subscription_count() >= joints
        )
        return matched or time.monotonic() - self._born > PEERS_PATIENCE_S

    def _pump(self) -> None:
        """Send what credits and the clock allow."""
        if not self._begun:
            if not self._everyone_is_here():
                return
            self._begun = True
            self._frames.begin(self._start_ns)
        # A few blocks a call: without any credits to wait for, the executor must still get its turn.
        for _ in range(8):
            count = min(self._block, self._programme.available)
            if not count:
                if self._programme.over:
                    self._farewell()
                else:
                    self._wait()
                return
            until = self._programme.time_of(count)
            if self._stamp(until) > self._true_motion.limit_ns or not self._pace.allows(until):
                return
            self._send(self._programme.block(count))

    def _wait(self) -> None:
        """Without a goal: let as much time pass as `idle_speed` says."""
        assert self._goals is not None
        self._pace.restart()
        until = self._goals.time_of(self._block)
        if self._idle.runs and self._idle.allows(until):
            self._goals.rest(self._block)

    def _send(self, m: TableMotion) -> None:
        """Send a block, status first: it holds for what comes after it."""
        for k in reported_samples(m, self._before):
            self._send_status(m, int(k))
        last = len(m.t) - 1
        for k in range(-self._sent % self._every, last + 1, self._every):
            self._send_joints(m, k)
        self._sent += len(m.t)
        self._before = m
        # Who waits for the end of a goal must see it, whatever the grid of the joint states.
        if self._goals is not None and not self._goals.available and (self._sent - 1) % self._every:
            self._send_joints(m, last)
        message = encode_motion(self._start_ns, m.t, m.q_nt, m.omega_nt_t)
        self._true_motion.publish(message, self._stamp(float(m.t[-1])))
        if self._server is not None:
            self._server.sent()

    def _send_status(self, m: TableMotion, k: int) -> None:
        phase, stop = "dwell" if m.dwell[k] else "rotating", str(int(m.stop[k]))
        values = [KeyValue(key="phase", value=phase), KeyValue(key="stop", value=stop)]
        status = DiagnosticStatus(name="rate_table", message=phase, hardware_id="rate_table", values=values)
        self._status_ns = self._stamp(float(m.t[k]))
        self._status.publish(DiagnosticArray(header=header(self._status_ns), status=[status]), self._status_ns)

    def _send_joints(self, m: TableMotion, k: int) -> None:
        message = JointState(header=header(self._stamp(float(m.t[k]))), name=list(m.names))
        message.position, message.velocity = m.encoder_angle[k].tolist(), m.rate[k].tolist()
        self._joints.publish(message)
        self._frames.send(self._stamp(float(m.t[k])), m, k)

    def _stamp(self, t: float) -> int:
        return self._start_ns + round(t * NS)

    def _farewell(self) -> None:
        """Say the end once, then leave when everyone has everything."""
        if self._departed is None:
            assert self._before is not None
            self._departed = time.monotonic()
            self._true_motion.end(self._stamp(float(self._before.t[-1])))
            self._status.end(self._status_ns)
        complete = self._true_motion.acknowledged and self._status.acknowledged
        if (complete or time.monotonic() - self._departed > FAREWELL_S) and not self.done.done():
            self.done.set_result(None)


def main() -> None:
    """Run the node."""
    run_node(RateTableNode)


if __name__ == "__main__":
    main()
