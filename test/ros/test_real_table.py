"""A table under ros2_control, as far as its topics go: trajectories in, joint states out, and not a word besides."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from scipy.interpolate import CubicHermiteSpline
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.nodes.credits import HISTORY, header, to_ns

from .conftest import DEADLINE_S, FitSession, write_plan

pytestmark = pytest.mark.ros

GOALS = "sdimu_calibration.nodes.table_goals_node"
JOINTS = ["yaw", "roll", "pitch"]
"""In the order of its own: neither that of the axes nor the alphabet's."""
FASTER = 3.0
"""Seconds of the controller in a second of the wall clock (1): to wait a second for a busy core is less than a stop."""
LATEST = 1.3 * FASTER
"""How late an arrival or an end may be noticed (s of the controller): by less than a stop, and 1.3 s of a busy core."""
START = 1_700_000_000 * 10**9
TABLE = """
format: sdimu-table/1
axes: {outer: Y, middle: Z, inner: X}
joints: {outer: pitch, middle: yaw, inner: roll}
limits:
  outer: {rate: 60 deg/s, acceleration: 60 deg/s^2}
  middle: {rate: 60 deg/s, acceleration: 60 deg/s^2}
  inner: {rate: 60 deg/s, acceleration: 60 deg/s^2}
"""


class Controller:
    """Follows the cubic through the points, three times as fast as the wall clock, with encoders of one arcsecond."""

    def __init__(self) -> None:
        self._context = Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = Node("table_controller", context=self._context)
        self._states = self._node.create_publisher(JointState, "joint_states", 10)
        self._node.create_subscription(JointTrajectory, "~/joint_trajectory", self._take, 10)
        self._node.create_subscription(DiagnosticArray, "rate_table/status", self._hear, HISTORY)
        self._node.create_timer(0.002, self._publish)
        self._executor = EventsExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._born = time.monotonic()
        self._curve: CubicHermiteSpline | None = None
        self._random = np.random.default_rng(1)
        self.at, self.rate = np.zeros(3), np.zeros(3)
        self.deaf = False
        self.fastest = 0.0
        self.phases: list[tuple[float, str, str]] = []

    def _now(self) -> float:
        return FASTER * (time.monotonic() - self._born)

    def _take(self, m: JointTrajectory) -> None:
        if self.deaf:
            return
        order = [list(m.joint_names).index(name) for name in JOINTS]
        now = self._now()
        seconds = [p.time_from_start.sec + p.time_from_start.nanosec * 1e-9 for p in m.points]
        angles = [self.at, *(np.array(p.positions)[order] for p in m.points)]
        rates = [self.rate, *(np.array(p.velocities)[order] for p in m.points)]
        self._curve = CubicHermiteSpline([now, *(now + s for s in seconds)], angles, rates)

    def _hear(self, m: DiagnosticArray) -> None:
        values = {v.key: v.value for v in m.status[0].values}
        self.phases.append(((to_ns(m.header.stamp) - START) * 1e-9, values["phase"], values["stop"]))

    def _publish(self) -> None:
        now = self._now()
        if self._curve is not None:
            inside = min(now, self._curve.x[-1])
            self.at, self.rate = self._curve(inside), self._curve(inside, 1) if now < self._curve.x[-1] else np.zeros(3)
            self.fastest = max(self.fastest, float(np.abs(self.rate).max()))
        read = self.at + np.radians(1.0 / 3600.0) * self._random.standard_normal(3)
        message = JointState(header=header(START + round(now * 1e9)), name=JOINTS)
        message.position, message.velocity = read.tolist(), self.rate.tolist()
        self._states.publish(message)

    def spin(self, seconds: float) -> None:
        self._executor.spin_until_future_complete(Future(), seconds)

    def close(self) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()


@pytest.fixture
def controller(bench: FitSession) -> Iterator[Controller]:
    assert bench.children is not None  # the controller is in its domain
    made = Controller()
    yield made
    made.close()


def drive(bench: FitSession, **more: object) -> None:
    table = Path(bench.folder / "table.yaml")
    table.write_text(TABLE)
    write_plan(bench.plan, 4.0)
    parameters = {"plan": str(bench.plan), "table": str(table), "allow_motion": True} | more
    remapped = ("joint_trajectory:=/table_controller/joint_trajectory", "joint_states:=/joint_states")
    words = [word for text in remapped for word in ("-r", f"rate_table/{text}")]
    for key, value in parameters.items():
        words += ["-p", f"{key}:={str(value).lower() if isinstance(value, bool) else value}"]
    bench.children.run("table_goals", GOALS, ["--ros-args", *words])


def spin_to_end(bench: FitSession, controller: Controller) -> None:
    begun = time.monotonic()
    while bench.children.running():
        assert time.monotonic() - begun < DEADLINE_S
        controller.spin(0.05)


def test_a_plan_is_carried_out_and_the_driver_tells_the_phases(bench: FitSession, controller: Controller) -> None:
    drive(bench)
    spin_to_end(bench, controller)
    # Pitch by the turn about Y, yaw by the one about Z, in the order of the controller.
    np.testing.assert_allclose(np.degrees(controller.at), [90.0, 0.0, 90.0], atol=0.05)
    assert np.degrees(controller.fastest) < 45.0
    changes = [p for k, p in enumerate(controller.phases) if k == 0 or p[1:] != controller.phases[k - 1][1:]]
    assert [p[1:] for p in changes] == [
        ("dwell", "0"),
        ("rotating", "0"),
        ("dwell", "1"),
        ("rotating", "1"),
        ("dwell", "2"),
    ]
    starts, arrivals = [changes[k][0] for k in (1, 3)], [changes[k][0] for k in (2, 4)]
    for begin, end in zip(starts, arrivals, strict=True):
        assert 3.0 <= end - begin < 3.0 + LATEST
    # The stop between the turns is as long as it was asked for, however late the arrival is noticed.
    assert 3.0 + 4.0 - 0.2 < starts[1] - starts[0] < 3.0 + 4.0 + LATEST


def test_a_controller_that_refuses_in_silence_is_noticed(bench: FitSession, controller: Controller) -> None:
    controller.deaf = True
    drive(bench)
    with pytest.raises(DataError, match=r"has not begun to move \(has its controller refused the trajectory"):
        spin_to_end(bench, controller)
    assert not controller.at.any()
