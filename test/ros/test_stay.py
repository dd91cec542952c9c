"""A calibration node that stays: what comes after the end of a stream, and a second stream after ~/reset."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import Imu
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from sdimu_calibration.nodes.credits import HISTORY, LATCHED, STREAM, header
from sdimu_calibration.storage.bags.cdr import encode_imu, encode_status
from sdimu_calibration.storage.files.result_file import read_result

from .conftest import CALIBRATION, DEADLINE_S, FitSession

pytestmark = pytest.mark.ros

START = 1_700_000_000 * 10**9
RATE = 100


class Driver:
    """An IMU at rest that says where its stream ends, without waiting for credits."""

    def __init__(self) -> None:
        self.context = Context()
        rclpy.init(context=self.context)
        self.node = Node("driver", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.imu = self.node.create_publisher(Imu, "/imu/data_raw", STREAM)
        self.status = self.node.create_publisher(DiagnosticArray, "/rate_table/status", HISTORY)
        self.end = self.node.create_publisher(Header, "/imu/data_raw/end", LATCHED)

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()

    def wait_for_listeners(self) -> None:
        begun = time.monotonic()
        while not all(p.get_subscription_count() for p in (self.imu, self.status, self.end)):
            assert time.monotonic() - begun < 120.0
            time.sleep(0.05)

    def tell_end(self, last_s: int) -> None:
        self.end.publish(header(START + last_s * 10**9))

    def send(self, first_s: int, seconds: int) -> None:
        rng = np.random.default_rng(first_s)
        count = seconds * RATE
        ns = START + first_s * 10**9 + (1 + np.arange(count, dtype=np.int64)) * (10**9 // RATE)
        omega = 4e-5 + 1e-6 * rng.standard_normal((count, 3))
        messages = encode_imu(ns, omega, [0.0, 0.0, -9.8] + 1e-3 * rng.standard_normal((count, 3)))
        said = START + (first_s + np.arange(seconds + 1, dtype=np.int64)) * 10**9
        for message in encode_status(said, np.ones(len(said), bool), np.zeros(len(said), np.int64)):
            self.status.publish(message)
        for message in messages:
            self.imu.publish(message)

    def call(self, service: str) -> Trigger.Response:
        client = self.node.create_client(Trigger, f"/calibration/{service}")
        assert client.wait_for_service(DEADLINE_S)
        future = client.call_async(Trigger.Request())
        self.executor.spin_until_future_complete(future, DEADLINE_S)
        return future.result()


def samples_in(folder: Path) -> int:
    return read_result(folder).data["samples"] if (folder / "result.json").is_file() else 0


@pytest.mark.parametrize("checkpoint", [True, False])
def test_a_node_that_stays_takes_what_comes_after_an_end_and_begins_anew_on_request(
    bench: FitSession, checkpoint: bool
) -> None:
    bench.children.start(
        "calibration",
        CALIBRATION,
        {
            "out": str(bench.folder),
            "stay": True,
            "checkpoint": checkpoint,
            "accel_unit": "m/s^2",
            "gyro_unit": "rad/s",
            "accel_sign": 1,
            "gyro_sign": 1,
        },
    )
    driver = Driver()
    try:
        driver.wait_for_listeners()
        journal = bench.folder / "calibration.journal"
        for first, expected in ((0, 4000), (40, 8000)):
            driver.send(first, 40)
            driver.tell_end(first + 40)
            bench.wait(lambda expected=expected: samples_in(bench.folder) == expected, f"result of {expected}")
            assert bench.children.running()
            assert journal.exists() == checkpoint
        assert driver.call("save").success
        assert samples_in(bench.folder) == 8000
        assert driver.call("reset").success
        driver.send(0, 50)
        driver.tell_end(50)
        bench.wait(lambda: samples_in(bench.folder) == 5000, "result after the reset")
        assert bench.children.running()
    finally:
        driver.close()
    assert bench.children.stop("calibration", 2) == 0
    assert not journal.exists()


def test_samples_that_come_after_the_end_was_given_up_are_in_the_result(bench: FitSession) -> None:
    """A packet that was lost is sent again seconds later, when the end has long been told on a topic of its own."""
    stated = {"accel_unit": "m/s^2", "gyro_unit": "rad/s", "accel_sign": 1, "gyro_sign": 1}
    bench.children.start(
        "calibration", CALIBRATION, {"out": str(bench.folder), "stay": True, "diagnose": False} | stated
    )
    driver = Driver()
    try:
        driver.wait_for_listeners()
        driver.send(0, 40)
        driver.tell_end(60)
        bench.wait(lambda: samples_in(bench.folder) == 4000, "result without the end")
        driver.send(40, 20)
        bench.wait(lambda: samples_in(bench.folder) == 6000, "result with what came late")
        assert bench.children.running()
    finally:
        driver.close()
