"""The driver of a table, without a table: brakes within the stops and after a signal, questions that stay open."""

from __future__ import annotations

import math

import numpy as np
import pytest
import rclpy
from rcl_interfaces.msg import SetParametersResult
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool

from sdimu_calibration.core.plan import Turn
from sdimu_calibration.core.table import AxisLimits, RateTable, Step
from sdimu_calibration.nodes import stopping
from sdimu_calibration.nodes.credits import NS, header
from sdimu_calibration.nodes.table_driver import TableDriver
from sdimu_calibration.nodes.table_progress import Seen
from sdimu_calibration.nodes.trajectory_messages import braking, duration_ns

DEG = math.radians(1.0)
JOINTS = ("outer", "middle", "inner")
STEP = Step(Turn("X", 90.0 * DEG, 10.0 * DEG), 5.0)


def table(**limits: float) -> RateTable:
    one = AxisLimits(rate_rad_s=60.0 * DEG, acceleration_rad_s2=20.0 * DEG, **limits)
    return RateTable("tested", ("Y", "Z", "X"), JOINTS, (one, one, one))


class Chores:
    """A ticker whose time the test makes."""

    def __init__(self):
        self.actions = []

    def every(self, _period_s, action):
        self.actions.append(action)

    def tick(self):
        for action in self.actions:
            action()


class Controller:
    """A publisher of trajectories with so many listeners."""

    topic_name = "/joint_trajectory"

    def __init__(self, listeners):
        self.listeners, self.taken = listeners, []

    def get_subscription_count(self):
        return self.listeners

    def publish(self, message):
        self.taken.append(message)

    def wait_for_all_acked(self, timeout):
        assert 0 < timeout.nanoseconds <= 5 * NS
        return True


class Rig:
    def __init__(self, node, listeners):
        self.node, self.chores, self.controller = node, Chores(), Controller(listeners)
        self.driver = TableDriver(node, self.chores, table())
        self.driver._trajectory = self.controller
        self.joints(1.0, 0.0, 0.0)

    def joints(self, seconds, degrees, degrees_s):
        """The inner joint, which turns about X."""
        state = JointState(header=header(round(seconds * NS)), name=list(JOINTS))
        state.position, state.velocity = [0.0, 0.0, degrees * DEG], [0.0, 0.0, degrees_s * DEG]
        self.driver._take_joints(state)

    def answer(self, yes):
        return self.driver._answer(SetBool.Request(data=yes), SetBool.Response())

    def put(self, **parameters):
        return self.node.set_parameters_atomically([Parameter(name, value=v) for name, v in parameters.items()])


@pytest.fixture
def make():
    context = Context()
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    nodes = []

    def made(listeners=1, **given):
        overrides = [Parameter(name, value=value) for name, value in ({"allow_motion": True} | given).items()]
        nodes.append(Node("tested", namespace="alone", context=context, parameter_overrides=overrides))
        return Rig(nodes[-1], listeners)

    yield made
    for node in nodes:
        node.destroy_node()
    context.try_shutdown()


def test_the_brake_goes_out_after_a_signal(make, monkeypatch):
    rig = make()
    future = rig.driver.move(STEP)
    rig.joints(3.0, 15.0, 10.0)
    monkeypatch.setattr(stopping, "_asked", True)
    rig.driver.stop("the node was stopped")
    sent, brake = rig.controller.taken
    assert brake.header.frame_id == f"{sent.header.frame_id}/brake"
    assert not any(brake.points[-1].velocities)
    assert future.result().reason == "the node was stopped"


@pytest.mark.parametrize(
    ("limits", "at_deg", "rate_deg_s"),
    [
        ({"angle_rad": 100.0 * DEG}, 92.2, 10.0),
        ({"angle_rad": 100.0 * DEG}, -92.2, -10.0),
        ({"angle_rad": 100.0 * DEG}, 97.5, 10.0),
        ({"cable_turns": 0.25}, 85.0, 10.0),
    ],
)
def test_a_brake_ends_within_stops_and_cable_and_within_the_deceleration(limits, at_deg, rate_deg_s):
    described = table(**limits)
    rates = np.array([0.0, rate_deg_s * DEG, 0.0])
    (point,) = braking(described, Seen(NS, np.array([0.0, at_deg * DEG, 0.0]), rates, 0), "brake").points
    end, reach = point.positions[1], described.limits[1].reach_rad
    assert abs(at_deg * DEG) < abs(end) <= reach + 1e-9
    # Constant deceleration: the mean rate on the way is half of the first.
    seconds = duration_ns(point) / NS
    assert end - at_deg * DEG == pytest.approx(0.5 * rates[1] * seconds, rel=1e-6)
    assert abs(rates[1]) / seconds <= described.limits[1].acceleration_rad_s2 * (1.0 + 1e-6)


def test_a_brake_far_from_the_stops_is_gentle():
    seen = Seen(NS, np.zeros(3), np.array([0.0, 0.0, 10.0 * DEG]), 0)
    (point,) = braking(table(angle_rad=100.0 * DEG), seen, "brake").points
    assert duration_ns(point) == 2 * NS
    assert point.positions[2] == pytest.approx(10.0 * DEG)


def test_a_yes_holds_until_a_controller_listens(make):
    rig = make(listeners=0, ask=True)
    rig.driver.move(STEP)
    assert rig.answer(yes=True).success
    rig.chores.tick()
    assert not rig.controller.taken
    rig.controller.listeners = 1
    rig.chores.tick()
    rig.chores.tick()
    assert len(rig.controller.taken) == 1
    assert not rig.answer(yes=True).success


def test_a_question_stays_open_when_asking_is_switched_off(make):
    rig = make(ask=True)
    future = rig.driver.move(STEP)
    assert rig.put(ask=False).successful
    rig.chores.tick()
    assert not rig.controller.taken
    assert rig.answer(yes=False).success
    assert "a person said no" in future.result().reason
    rig.driver.move(STEP)
    assert len(rig.controller.taken) == 1, "the next move is not asked for"


def test_a_move_that_waits_for_its_controller_is_asked_for_when_asking_is_switched_on(make):
    rig = make(listeners=0)
    rig.driver.move(STEP)
    assert rig.put(ask=True).successful
    rig.controller.listeners = 1
    rig.chores.tick()
    assert not rig.controller.taken
    assert rig.answer(yes=True).success
    assert len(rig.controller.taken) == 1


def test_parameters_that_are_refused_together_change_nothing(make):
    rig = make()
    rig.driver.move(STEP)
    rig.node.add_on_set_parameters_callback(lambda _: SetParametersResult(successful=False, reason="not now"))
    assert not rig.put(allow_motion=False, ask=True).successful
    assert rig.driver.busy
    assert len(rig.controller.taken) == 1
