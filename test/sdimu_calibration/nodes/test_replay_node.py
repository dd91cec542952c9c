"""The replay node without its topics: what it sends, in which order, and when it leaves."""

import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.task import Future

from sdimu_calibration.nodes import replay_node
from sdimu_calibration.nodes.credits import NS, Producer, header
from sdimu_calibration.nodes.replay_node import ReplayNode

IMU, JOINTS = "imu/data_raw", "rate_table/joint_states"
STEP_NS = NS // 100
CONSUMER = "/calibration"


def replay(queue: list[tuple[int, str, bytes]]) -> tuple[Any, Producer, list[tuple[str, bytes]]]:
    """A node that plays a queue, its producer with one consumer that is ready, and the list of what was sent."""
    sent: list[tuple[str, bytes]] = []

    def publisher(topic: str) -> Any:
        return SimpleNamespace(publish=lambda message: sent.append((topic, message)))

    producer: Any = object.__new__(Producer)
    producer._window_ns, producer._on_credit = 200 * STEP_NS, None
    producer._peers, producer._sent_ns, producer._end_ns = {}, None, None
    producer._node = SimpleNamespace(get_fully_qualified_name=lambda: "/replay")
    producer.publisher, producer._end_publisher = publisher(IMU), publisher("end")
    producer._take_credit(header(0, CONSUMER))
    node: Any = object.__new__(ReplayNode)
    node._imu, node._others, node._imu_topic = producer, {JOINTS: publisher(JOINTS)}, IMU
    node._queue, node._next, node._speed, node._first_ns = queue, 0, 0.0, queue[0][0]
    node._end_ns = max(stamp for stamp, topic, _ in queue if topic == IMU)
    node._begun, node._departed, node.done = time.monotonic(), None, Future()
    return node, producer, sent


def reached(sent: list[tuple[str, bytes]]) -> int:
    """Stamp (ns) of the last sample that was sent."""
    return max(int(message) for topic, message in sent if topic == IMU)


def play(node: Any, producer: Any, sent: list[Any], until: Callable[[], bool]) -> None:
    for _ in range(50):
        node._pump()
        producer._take_credit(header(reached(sent), CONSUMER))
        if until():
            return


def stream(topic: str, first: int, last: int) -> list[tuple[int, str, bytes]]:
    return [(NS + k * STEP_NS, topic, str(NS + k * STEP_NS).encode()) for k in range(first, last)]


@pytest.mark.parametrize(
    "queue",
    [
        [*stream(IMU, 0, 500), *stream(JOINTS, 0, 2000)],
        [*stream(IMU, 0, 500), *stream(JOINTS, 0, 2000), *stream(IMU, 1500, 2000)],
    ],
    ids=["after the last sample", "in a gap of the samples"],
)
def test_what_no_sample_accompanies_is_sent_too_and_the_replay_ends(queue):
    node, producer, sent = replay(sorted(queue))
    play(node, producer, sent, node.done.done)
    assert len([one for one in sent if one[0] != "end"]) == len(queue)
    assert node.done.done()


def test_a_consumer_that_is_behind_holds_the_replay():
    node, _, sent = replay(sorted([*stream(IMU, 0, 500), *stream(JOINTS, 0, 2000)]))
    for _ in range(2 * len(node._queue) // replay_node.BURST):
        node._pump()
    assert reached(sent) == NS + 200 * STEP_NS
