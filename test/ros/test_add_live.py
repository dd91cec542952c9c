"""An effect that is added by a parameter while the samples come: the error falls, and nothing is lost."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import SetParameters
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rosbags.highlevel import AnyReader

from sdimu_calibration.nodes.credits import HISTORY
from sdimu_calibration.storage.files.result_file import read_result

from .conftest import DEADLINE_S, FitSession, imu_stamps

pytestmark = pytest.mark.ros

EFFECT = "gyro_scale_asymmetry_y"
RATE_HZ, DWELL_S = 20.0, 60.0
PLAN = f"""format: sdimu-plan/1
name: five turns
dwell: {DWELL_S} s
rate: 18 deg/s
acceleration: 60 deg/s^2
turns:
  - {{axis: Y, angle: 90 deg}}
  - {{axis: Y, angle: 180 deg}}
  - {{axis: Y, angle: -180 deg}}
  - {{axis: Z, angle: 90 deg}}
  - {{axis: Z, angle: 180 deg}}
"""


class Operator:
    """Somebody who reads the diagnosis, and sets a parameter as `ros2 param set` does."""

    def __init__(self) -> None:
        self.context = Context()
        rclpy.init(context=self.context)
        self.node = Node("operator", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.seen: list[DiagnosticArray] = []
        self.node.create_subscription(DiagnosticArray, "/calibration/diagnosis", self.seen.append, HISTORY)
        self.parameters = AsyncParameterClient(self.node, "calibration")

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()

    def wait(self, condition, what: str) -> None:
        begun = time.monotonic()
        while not condition():
            assert time.monotonic() - begun < DEADLINE_S, what
            self.executor.spin_once(0.05)

    def add(self, *effects: str) -> tuple[bool, str]:
        value = Parameter("add", Parameter.Type.STRING_ARRAY, list(effects))
        answer = self.parameters.set_parameters([value])
        self.wait(answer.done, "the parameter is not answered")
        response: SetParameters.Response = answer.result()
        return response.results[0].successful, response.results[0].reason


def values(message, name: str) -> dict[str, str]:
    (status,) = (status for status in message.status if status.name == name)
    return {entry.key: entry.value for entry in status.values}


def of_topic(bag: Path, topic: str) -> list:
    with AnyReader([bag]) as reader:
        connections = [c for c in reader.connections if c.topic == topic]
        return [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages(connections)]


def test_an_effect_that_is_added_while_the_samples_come_lowers_the_error(bench: FitSession) -> None:
    bench.plan.write_text(PLAN, encoding="utf-8")
    bench.speed = 40.0
    for name in ("recorder", "calibration", "sdimu", "rate_table"):
        more = {
            "calibration": {"diagnose": True, "gyro_unit": "rad/s", "gyro_sign": 1},
            "sdimu": {"rate_hz": RATE_HZ, "effects": [f"{EFFECT}=400 ppm"], "seed": 7},
        }
        bench.start(name, **more.get(name, {}))
    operator = Operator()
    try:
        operator.wait(lambda: bench.children.running() and operator.seen, "no diagnosis")
        refused = operator.add("gyro_scale_asymetry_y")
        taken = operator.add(EFFECT)
        operator.wait(lambda: not bench.children.running(), "the end of all nodes")
    finally:
        operator.close()

    assert refused[0] is False
    assert "gyro_scale_asymetry_y" in refused[1]
    assert "\n" not in refused[1]
    assert taken == (True, "")
    stamps = imu_stamps(bench.folder / "bag")
    assert set(np.diff(stamps)) == {round(1e9 / RATE_HZ)}
    result = read_result(bench.folder)
    assert result.names[-1] == EFFECT
    assert result.data["samples"] == len(stamps)
    assert result.data["lost"] == 0

    last = of_topic(bench.folder / "bag", "/calibration/diagnosis")[-1]
    ladder = {name: float(error) for name, error in values(last, "ladder").items()}
    assert list(ladder) == ["as given", f"+ {EFFECT}"]
    assert ladder[f"+ {EFFECT}"] < ladder["as given"]
    assert values(last, "verdict")["verdict"] == "consistent"
    heat_map = of_topic(bench.folder / "bag", "/calibration/heat_map")[-1]
    channels, stops, _ = heat_map.layout.dim
    assert channels.label.split(":")[1].split(",")[-1] == "accel_z"
    assert stops.label == "stop:0,1,2,3,4,5"
    assert len(heat_map.data) == channels.size * stops.size == 72
    coefficients = of_topic(bench.folder / "bag", "/calibration/coefficients")
    names = [EFFECT in message.name for message in coefficients]
    assert not names[0]
    # Before the last one, which is of the end: the filter on the way went on with the effect.
    assert names[-2]
    seconds = [message.header.stamp.sec for message in coefficients[:-1]]
    assert seconds == sorted(set(seconds))
