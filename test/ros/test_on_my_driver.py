"""doc/on-my-driver.md, tried: a driver of best effort at 200 Hz with jittering stamps, and nobody who tells phases."""

from __future__ import annotations

import time

import numpy as np
import pytest
import rclpy
from rclpy.context import Context
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from sensor_msgs.msg import Imu
from std_srvs.srv import Trigger

from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.storage.bags.bag_writer import BagContent, write_recording
from sdimu_calibration.storage.bags.cdr import encode_imu
from sdimu_calibration.storage.files.config import load_imu, load_site
from sdimu_calibration.storage.files.result_file import read_result
from sdimu_sim.core.scenario import Scenario, generate

from .conftest import CALIBRATION, DEADLINE_S, FitSession, sdimu

pytestmark = pytest.mark.ros

RATE_HZ = 200
START = 1_700_000_000 * 10**9
TURNS = tuple(Turn(axis, np.pi / 2, np.radians(30.0)) for axis in "YZ")
PLAN = Plan("three stops", (25.0, 25.0, 25.0), TURNS, np.radians(60.0))
SENSOR_DATA = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
"""What most drivers offer: rclcpp::SensorDataQoS."""
BATCH, PAUSE_S = 10, 0.01


def test_a_driver_of_best_effort_with_jitter_and_without_phases_is_calibrated(bench: FitSession) -> None:
    r = generate(Scenario(PLAN, load_imu("dtg"), load_site("daejeon"), rate_hz=RATE_HZ, seed=5))[0]
    jitter = np.random.default_rng(8).uniform(-1e-3, 1e-3, len(r.t))
    ns = np.rint((r.t + jitter) * 1e9).astype(np.int64)
    sent = encode_imu(START + ns, r.omega_ib_b, r.f_ib_b)
    bench.children.start(
        "calibration",
        CALIBRATION,
        {"imu_topic": "/my_imu/data", "imu": "dtg", "site": "daejeon", "out": str(bench.folder), "stay": True},
    )
    context = Context()
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    node = Node("driver", context=context)
    executor = EventsExecutor(context=context)
    executor.add_node(node)
    try:
        publisher = node.create_publisher(Imu, "/my_imu/data", SENSOR_DATA)
        log = bench.folder / "log" / "calibration.log"
        bench.wait(lambda: "best effort only" in log.read_text(encoding="utf-8"), "the fall back to best effort")
        bench.wait(publisher.get_subscription_count, "a subscriber")
        time.sleep(1.0)
        for k in range(0, len(sent), BATCH):
            for message in sent[k : k + BATCH]:
                publisher.publish(message)
            time.sleep(PAUSE_S)
        client = node.create_client(Trigger, "/calibration/save")
        bench.wait(client.service_is_ready, "the service")
        time.sleep(2.0)
        future: Future = client.call_async(Trigger.Request())
        executor.spin_until_future_complete(future, DEADLINE_S)
        assert future.result().success, future.result().message
    finally:
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()
    live = read_result(bench.folder / "result.json")
    # What best effort loses is counted, not guessed.
    assert abs(live.data["samples"] + live.data["lost"] - len(sent)) <= 2
    assert live.data["samples"] > 0.95 * len(sent)
    assert live.data["stops"] == 3
    assert "samples are taken as even" in " ".join(live.notes)
    bag, again = bench.folder / "whole", bench.folder / "again"
    write_recording(bag, BagContent(start_ns=START, imu_ns=ns, omega_ib_b=r.omega_ib_b, f_ib_b=r.f_ib_b))
    process = sdimu("calibrate", bag, "--imu", "dtg", "--site", "daejeon", "--out", again)
    _, err = process.communicate(timeout=DEADLINE_S)
    assert process.returncode in (0, 3), err
    whole = read_result(again / "result.json")
    assert (np.abs(live.values - whole.values) <= 0.5 * np.sqrt(np.diag(whole.covariance))).all()
