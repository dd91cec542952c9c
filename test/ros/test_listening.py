"""IMU drivers that do not offer reliable delivery."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
import pytest
import rclpy
from rclpy.context import Context
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.task import Future
from sensor_msgs.msg import Imu

from sdimu_calibration.nodes.credits import STREAM, stamp_of
from sdimu_calibration.nodes.listening import Listener
from sdimu_calibration.nodes.ticking import Ticker
from sdimu_calibration.storage.bags.cdr import encode_imu

from .conftest import FitSession

pytestmark = pytest.mark.ros


class Pair:
    """A node and its executor, in a context of its own."""

    def __init__(self) -> None:
        self.context = Context()
        rclpy.init(context=self.context)
        self.node = Node("pair", context=self.context)
        self.executor = EventsExecutor(context=self.context)
        self.executor.add_node(self.node)

    def spin(self, seconds: float) -> None:
        self.executor.spin_until_future_complete(Future(), seconds)


@pytest.fixture
def pair(bench: FitSession) -> Iterator[Pair]:  # noqa: ARG001 (for its domain)
    pair = Pair()
    yield pair
    pair.executor.shutdown()
    pair.node.destroy_node()
    pair.context.try_shutdown()


@pytest.mark.parametrize(
    "offered",
    [QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT), STREAM],
    ids=["best effort", "reliable"],
)
def test_both_reliabilities_are_heard(pair: Pair, offered: QoSProfile) -> None:
    heard: list[int] = []
    ticker = Ticker(pair.node)
    listener = Listener(pair.node, ticker, Imu, "/imu/data_raw", lambda raw: heard.append(stamp_of(raw)), raw=True)
    publisher = pair.node.create_publisher(Imu, "/imu/data_raw", offered)
    stamps = np.arange(1, 1000) * 10_000_000
    zeros = np.zeros((len(stamps), 3))
    messages = encode_imu(stamps, zeros, zeros, "imu")
    begun = time.monotonic()
    for message in messages:
        publisher.publish(message)
        pair.spin(0.01)
        if len(heard) > 20 or time.monotonic() - begun > 15.0:
            break
    assert listener is not None
    assert len(heard) > 20
    assert set(np.diff(heard)) == {10_000_000}
