"""Node of the simulated rate table: plays a plan, publishes status, joint states, frames and its true motion.

Parameters: plan, table (names or paths), seed, speed (0 = as fast as credits allow, N = N times real time),
start_ns (stamp of the start), joint_rate_hz, consumers (how many must have granted a credit on the true motion
before the table moves), status_peers and joint_peers (subscribers to wait for, at most five seconds).
"""

from __future__ import annotations

import time

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from rate_table_sim.core import TableMotion, phase_changes, table_motion
from rate_table_sim.nodes.motion_message import encode_motion
from rate_table_sim.nodes.table_frames import TableFrames
from rate_table_sim.table_file import load_table
from sdimu_calibration.nodes.credits import HISTORY, NS, Producer, header
from sdimu_calibration.nodes.spinning import run_node
from sdimu_calibration.nodes.ticking import Ticker
from sdimu_calibration.storage.config import load_plan

TICK_S = 0.005
FAST_BLOCK = 50
REAL_TIME_BLOCK_S = 0.02
WINDOW_S = 2.0
PEERS_PATIENCE_S = 5.0
FAREWELL_S = 20.0


class RateTableNode:
    """Plays a test plan; see the module for its parameters."""

    def __init__(self) -> None:
        self.node = Node("rate_table")
        self.done = Future()
        declare = self.node.declare_parameter
        plan = load_plan(declare("plan", "kim18").value)
        table = load_table(declare("table", "ideal").value)
        self._speed = float(declare("speed", 0.0).value)
        self._start_ns = int(declare("start_ns", 1_700_000_000 * NS).value)
        self._needed = int(declare("consumers", 0).value)
        self._peers = (int(declare("status_peers", 0).value), int(declare("joint_peers", 0).value))
        self._motion = table_motion(plan, table, int(declare("seed", 1).value))
        self._names = list(self._motion.names)
        every = max(1, round(table.sample_rate_hz / float(declare("joint_rate_hz", 10.0).value)))
        self._joint_at = np.arange(0, len(self._motion.t), every)
        self._block = FAST_BLOCK if self._speed == 0.0 else max(1, round(table.sample_rate_hz * REAL_TIME_BLOCK_S))
        self._status_t, self._status_dwell, self._status_stop = phase_changes(self._motion)
        self._next = self._next_status = self._next_joint = 0
        self._born = time.monotonic()
        self._departed: float | None = None
        self._started: float | None = None
        ticker = Ticker(self.node)
        self._true_motion = Producer(
            self.node,
            ticker,
            Float64MultiArray,
            "/rate_table/true_motion",
            window_ns=int(WINDOW_S * NS),
            on_credit=self._pump,
        )
        self._status = Producer(self.node, ticker, DiagnosticArray, "/rate_table/status", qos=HISTORY)
        self._joints = self.node.create_publisher(JointState, "/rate_table/joint_states", HISTORY)
        self._frames = TableFrames(self.node, table, self._motion)
        self._timer = self.node.create_timer(TICK_S, self._pump)

    def close(self) -> None:
        """Nothing to leave behind."""

    def _everyone_is_here(self) -> bool:
        if self._true_motion.consumers < self._needed:
            return False
        status, joints = self._peers
        matched = (
            self._status.publisher.get_subscription_count() >= status
            and self._joints.get_subscription_count() >= joints
        )
        return matched or time.monotonic() - self._born > PEERS_PATIENCE_S

    def _pump(self) -> None:
        """Send what credits and the clock allow."""
        if self._started is None:
            if not self._everyone_is_here():
                return
            self._started = time.monotonic()
            self._frames.begin(self._start_ns)
        t = self._motion.t
        # A few blocks a call: without any credits to wait for, the executor must still get its turn.
        for _ in range(8):
            if self._next >= len(t):
                self._farewell()
                return
            last = min(self._next + self._block, len(t)) - 1
            if self._stamp(t[last]) > self._true_motion.limit_ns:
                return
            if self._speed > 0.0 and t[last] > self._speed * (time.monotonic() - self._started):
                return
            self._send(last)

    def _send(self, last: int) -> None:
        """Send everything up to sample `last`, status first: it holds for what comes after it."""
        m = self._motion
        until = m.t[last]
        while self._next_status < len(self._status_t) and self._status_t[self._next_status] <= until:
            self._send_status(self._next_status)
            self._next_status += 1
        while self._next_joint < len(self._joint_at) and self._joint_at[self._next_joint] <= last:
            self._send_joints(m, int(self._joint_at[self._next_joint]))
            self._next_joint += 1
        block = slice(self._next, last + 1)
        message = encode_motion(self._start_ns, m.t[block], m.q_nt[block], m.omega_nt_t[block])
        self._true_motion.publish(message, self._stamp(until))
        self._next = last + 1

    def _send_status(self, k: int) -> None:
        phase, stop = "dwell" if self._status_dwell[k] else "rotating", str(int(self._status_stop[k]))
        values = [KeyValue(key="phase", value=phase), KeyValue(key="stop", value=stop)]
        status = DiagnosticStatus(name="rate_table", message=phase, hardware_id="rate_table", values=values)
        stamp = self._stamp(self._status_t[k])
        self._status.publish(DiagnosticArray(header=header(stamp), status=[status]), stamp)

    def _send_joints(self, m: TableMotion, k: int) -> None:
        message = JointState(header=header(self._stamp(m.t[k])), name=self._names)
        message.position, message.velocity = m.encoder_angle[k].tolist(), m.rate[k].tolist()
        self._joints.publish(message)
        self._frames.send(self._stamp(m.t[k]), k)

    def _stamp(self, t: float) -> int:
        return self._start_ns + round(t * NS)

    def _farewell(self) -> None:
        """Say the end once, then leave when everyone has everything."""
        if self._departed is None:
            self._departed = time.monotonic()
            self._true_motion.end(self._stamp(self._motion.t[-1]))
            self._status.end(self._stamp(self._status_t[-1]))
        complete = self._true_motion.acknowledged and self._status.acknowledged
        if (complete or time.monotonic() - self._departed > FAREWELL_S) and not self.done.done():
            self.done.set_result(None)


def main() -> None:
    """Run the node."""
    run_node(RateTableNode)


if __name__ == "__main__":
    main()
