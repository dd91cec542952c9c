"""A table that takes goals, over DDS: a plan by trajectories, refusals, hold, resume, stop, killed nodes."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.nodes.credits import HISTORY, LATCHED, header, to_ns
from sdimu_calibration.storage.files.result_file import read_result

from .conftest import DEADLINE_S, RATE_HZ, FitSession, imu_stamps, write_plan

pytestmark = pytest.mark.ros

GOALS = "sdimu_calibration.nodes.table_goals_node"
DEG = np.pi / 180
NAMES = ["outer", "middle", "inner"]


class Person:
    """Somebody at the table: sees what is published, sends trajectories, calls services."""

    def __init__(self) -> None:
        self._context = Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self.node = Node("person", context=self._context)
        self.joints: list[tuple[int, list[float], list[float]]] = []
        self.goals: list[tuple[str, str, str]] = []
        self.phases: list[tuple[int, str, str]] = []
        self.question = ""
        subscribe = self.node.create_subscription
        subscribe(JointState, "rate_table/joint_states", self._take_joints, HISTORY)
        subscribe(DiagnosticArray, "rate_table/goal_status", self._take_goal, HISTORY)
        subscribe(DiagnosticArray, "rate_table/status", self._take_status, HISTORY)
        subscribe(String, "table_goals/question", lambda m: setattr(self, "question", m.data), LATCHED)
        self.publisher = self.node.create_publisher(JointTrajectory, "rate_table/joint_trajectory", 10)
        self._executor = EventsExecutor(context=self._context)
        self._executor.add_node(self.node)

    def _take_joints(self, m: JointState) -> None:
        self.joints.append((to_ns(m.header.stamp), list(m.position), list(m.velocity)))

    def _take_goal(self, m: DiagnosticArray) -> None:
        values = {v.key: v.value for v in m.status[0].values}
        self.goals.append((values["state"], values["goal"], m.status[0].message))

    def _take_status(self, m: DiagnosticArray) -> None:
        values = {v.key: v.value for v in m.status[0].values}
        self.phases.append((to_ns(m.header.stamp), values["phase"], values["stop"]))

    def until(self, condition: Any, what: str) -> None:
        begun = time.monotonic()
        while not condition():
            assert time.monotonic() - begun < DEADLINE_S, f"{what}: {self.goals[-3:]}, {self.joints[-1:]}"
            self._executor.spin_until_future_complete(Future(), 0.02)

    def call(self, kind: type, name: str, request: Any) -> Any:
        client = self.node.create_client(kind, name)
        self.until(client.service_is_ready, name)
        future = client.call_async(request)
        self.until(future.done, name)
        return future.result()

    def trigger(self, name: str) -> Any:
        return self.call(Trigger, f"rate_table/{name}", Trigger.Request())

    def send(self, *points: tuple[float, list[float]], name: str = "", joints: list[str] | None = None) -> None:
        message = JointTrajectory(header=header(0, name), joint_names=NAMES if joints is None else joints)
        for seconds, degrees in points:
            at = Duration(sec=int(seconds), nanosec=round(seconds % 1.0 * 1e9))
            still = [0.0] * len(degrees)
            angles = [d * DEG for d in degrees]
            message.points.append(JointTrajectoryPoint(positions=angles, velocities=still, time_from_start=at))
        self.until(self.publisher.get_subscription_count, "a table that listens")
        self.publisher.publish(message)

    def told(self, state: str, name: str = "") -> str:
        """Wait for what the table says of a goal."""
        self.until(lambda: any(s == state and n == name for s, n, _ in self.goals), f"{state} {name}")
        return next(text for s, n, text in self.goals if s == state and n == name)

    @property
    def angles(self) -> np.ndarray:
        return np.array(self.joints[-1][1]) / DEG

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()


@pytest.fixture
def person(bench: FitSession) -> Iterator[Person]:
    assert bench.children is not None  # the person is in its domain
    made = Person()
    yield made
    made.close()


def start_table(bench: FitSession, **more: object) -> None:
    alone = {"follow_goals": True, "consumers": 0, "status_peers": 0, "joint_peers": 0, "plan": "kim18"}
    bench.start("rate_table", **(alone | more))


def test_goals_are_carried_out_refused_replaced_held_and_stopped(bench: FitSession, person: Person) -> None:
    start_table(bench, speed=20.0)
    person.until(lambda: person.joints, "the first joint states")
    person.send((4.0, [30.0, 0.0, 0.0]), (6.0, [30.0, 0.0, 0.0]), name="first")
    person.told("reached", "first")
    np.testing.assert_allclose(person.angles, [30.0, 0.0, 0.0], atol=1e-9)
    at = person.joints[-1][0]
    time.sleep(1.0)
    person.until(lambda: True, "")
    assert person.joints[-1][0] == at, "time must stand still without a goal"
    # Joints in another order are sorted by their names.
    person.send((4.0, [7.0, 30.0, 5.0]), name="sorted", joints=["inner", "outer", "middle"])
    person.told("reached", "sorted")
    np.testing.assert_allclose(person.angles, [30.0, 5.0, 7.0], atol=1e-9)
    for name, points, joints, word in (
        ("fast", [(0.1, [90.0, 5.0, 7.0])], None, "above the limit of 100 deg/s^2"),
        ("wound", [(400.0, [4000.0, 5.0, 7.0])], None, "10 turns that the cable allows"),
        ("strange", [(4.0, [0.0, 0.0, 0.0])], ["outer", "middle", "yaw"], "no joint 'yaw'"),
        ("partial", [(4.0, [0.0])], ["outer"], "joint 'middle' is missing"),
        ("backwards", [(4.0, [1.0, 0, 0]), (3.0, [2.0, 0, 0])], None, "does not ascend strictly"),
        ("short", [(4.0, [1.0, 0.0])], None, "2 positions for 3 joints"),
    ):
        person.send(*points, name=name, joints=joints)
        assert word in person.told("refused", name)
    np.testing.assert_allclose(person.angles, [30.0, 5.0, 7.0], atol=1e-9)

    person.send((60.0, [300.0, 5.0, 7.0]), (70.0, [300.0, 5.0, 7.0]), name="long")
    person.until(lambda: person.angles[0] > 60.0, "a turn under way")
    assert person.trigger("hold").success
    person.told("held", "long")
    person.until(lambda: not any(person.joints[-1][2]), "rest")
    held = person.angles[0]
    assert 60.0 < held < 250.0
    assert "goes on with long" in person.trigger("resume").message
    person.told("reached", "long")
    np.testing.assert_allclose(person.angles, [300.0, 5.0, 7.0], atol=1e-9)

    person.send((60.0, [0.0, 5.0, 7.0]), name="back")
    person.until(lambda: person.angles[0] < 280.0, "the way back")
    person.send((30.0, [290.0, 5.0, 7.0]), name="new")
    assert "replaced by new" in person.told("replaced", "back")
    person.told("reached", "new")
    person.send((60.0, [0.0, 5.0, 7.0]), name="again")
    person.until(lambda: person.angles[0] < 280.0, "the way back again")
    person.trigger("stop")
    person.told("stopped", "again")
    person.send((60.0, [0.0, 5.0, 7.0]), name="too early")
    assert "call the service resume first" in person.told("refused", "too early")
    person.trigger("resume")
    person.trigger("finish")
    bench.wait_for_end()
    rates = np.array([rate for _, _, rate in person.joints])
    assert np.abs(rates).max() < 100.0 * DEG


def test_an_empty_trajectory_stops_the_table(bench: FitSession, person: Person) -> None:
    start_table(bench, speed=10.0)
    person.until(lambda: person.joints, "the first joint states")
    person.send((40.0, [0.0, 200.0, 0.0]), name="turn")
    person.until(lambda: person.angles[1] > 20.0, "a turn under way")
    person.send(name="none")
    person.told("stopped", "turn")
    person.until(lambda: not any(person.joints[-1][2]), "rest")
    assert person.angles[1] < 190.0


def test_a_plan_by_goals_calibrates_as_the_plan_and_again_the_same(bench: FitSession) -> None:
    """The whole chain; the person says yes once, and nothing moves before."""
    write_plan(bench.plan, 12.0)
    bench.start("recorder")
    bench.start("calibration")
    bench.start("sdimu", rate_hz=100.0)
    bench.start("rate_table", follow_goals=True)
    driving = {"plan": str(bench.plan), "table": "ideal", "finish": True}
    bench.children.start("table_goals", GOALS, driving | {"allow_motion": True})
    bench.wait_for_end()
    stamps = imu_stamps(bench.folder / "bag")
    # 12 + 3 + 12 + 3 + 12 s, and at most one sample more for each of three moves; none is lost.
    assert 4200 <= len(stamps) <= 4200 + 3
    assert set(np.diff(stamps)) == {10**7}
    assert read_result(bench.folder).data["samples"] == len(stamps)


def test_nothing_moves_unless_it_is_allowed_and_a_person_is_asked(bench: FitSession, person: Person) -> None:
    write_plan(bench.plan, 5.0)
    start_table(bench)
    driving = {"plan": str(bench.plan), "table": "ideal"}
    bench.children.start("table_goals", GOALS, driving)
    with pytest.raises(DataError, match="nothing moves while the parameter allow_motion is false"):
        bench.wait_for_end()
    bench.children.start("table_goals", GOALS, driving | {"allow_motion": True, "ask": True})
    person.until(lambda: "Y +90 deg at 30 deg/s" in person.question, "the question")
    time.sleep(0.5)
    assert np.abs(person.angles).max() == 0.0
    answer = person.call(SetBool, "table_goals/confirm", SetBool.Request(data=True))
    assert answer.success
    person.until(lambda: "Z +90 deg" in person.question, "the second question")
    np.testing.assert_allclose(person.angles, [90.0, 0.0, 0.0], atol=1e-9)
    person.call(SetBool, "table_goals/confirm", SetBool.Request(data=False))
    with pytest.raises(DataError, match="a person said no"):
        bench.wait_for_end()
    np.testing.assert_allclose(person.angles, [90.0, 0.0, 0.0], atol=1e-9)


def test_motion_that_is_forbidden_on_the_way_comes_to_rest(bench: FitSession, person: Person) -> None:
    write_plan(bench.plan, 5.0)
    bench.plan.write_text(bench.plan.read_text().replace("90 deg", "180 deg").replace("rate: 30", "rate: 5"))
    start_table(bench, speed=5.0)
    driving = {"plan": str(bench.plan), "table": "ideal", "allow_motion": True}
    bench.children.start("table_goals", GOALS, driving)
    person.until(lambda: person.joints and person.angles[0] > 20.0, "a turn under way")
    client = AsyncParameterClient(person.node, "table_goals")
    done = client.set_parameters([Parameter("allow_motion", value=False)])
    person.until(done.done, "the answer")
    with pytest.raises(DataError, match="allow_motion was set to false"):
        bench.wait_for_end()
    person.until(lambda: not any(person.joints[-1][2]), "rest")
    assert 20.0 < person.angles[0] < 170.0


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_brings_the_table_to_rest(bench: FitSession, person: Person, how: signal.Signals) -> None:
    write_plan(bench.plan, 5.0)
    bench.plan.write_text(bench.plan.read_text().replace("90 deg", "180 deg").replace("rate: 30", "rate: 5"))
    start_table(bench, speed=5.0)
    driving = {"plan": str(bench.plan), "table": "ideal", "allow_motion": True}
    bench.children.start("table_goals", GOALS, driving)
    person.until(lambda: person.joints and person.angles[0] > 20.0, "a turn under way")
    assert bench.children.stop("table_goals", how) == 0
    person.until(lambda: not any(person.joints[-1][2]), "rest")
    assert 20.0 < person.angles[0] < 170.0


@pytest.mark.parametrize("victim", ["rate_table", "sdimu", "table_goals"])
def test_a_node_killed_in_a_turn_leaves_no_result_and_says_so(bench: FitSession, person: Person, victim: str) -> None:
    write_plan(bench.plan, 5.0)
    bench.plan.write_text(bench.plan.read_text().replace("rate: 30", "rate: 5"))
    bench.start("calibration")
    bench.start("sdimu", consumers=1)
    bench.start("rate_table", follow_goals=True, status_peers=1, speed=5.0)
    driving = {"plan": str(bench.plan), "table": "ideal", "allow_motion": True, "finish": True}
    bench.children.start("table_goals", GOALS, driving)
    person.until(lambda: person.joints and person.angles[0] > 20.0, "a turn under way")
    bench.children.kill(victim)
    if victim == "table_goals":
        # The table comes to the end of its move and stands there; a successor goes on from there.
        person.until(lambda: person.goals and person.goals[-1][0] == "reached", "the end of the move")
        np.testing.assert_allclose(person.angles, [90.0, 0.0, 0.0], atol=1e-9)
        assert person.phases[-1][1:] == ("dwell", "1")
        bench.children.start("table_goals", GOALS, driving)
        bench.wait_for_end()
        assert read_result(bench.folder).data["samples"] > 40 * RATE_HZ
        return
    time.sleep(4.0)
    assert not (bench.folder / "result.json").exists()
    assert "calibration" in bench.children.running()
