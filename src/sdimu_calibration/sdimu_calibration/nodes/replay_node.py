"""Node that plays a recording: raw messages of the input topics, in the order of their stamps, with credits.

Parameters: bag (path), imu_topic, status_topic, joint_topic, temperature_topic (of the bag; chosen as `sdimu calibrate`
does when empty; published under the names of the project), speed (0 = as fast as credits allow, N = N times real time),
consumers (how many must have granted a credit before it starts).
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import astuple
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import Imu, JointState, Temperature

from sdimu_calibration.core.recording import NOMINAL_FROM, DataError
from sdimu_calibration.nodes.credits import HISTORY, NS, STREAM, Producer, publish, stamp_of
from sdimu_calibration.nodes.parameters import Declare
from sdimu_calibration.nodes.spinning import run_node
from sdimu_calibration.nodes.ticking import Ticker
from sdimu_calibration.storage.bags.bag_reader import read_messages
from sdimu_calibration.storage.bags.topic_choice import TopicChoice, Topics

WINDOW_SAMPLES = 200
FAREWELL_S = 20.0
PEERS_PATIENCE_S = 5.0
TICK_S = 0.005
BURST = 400
_CLASSES: dict[str, type] = {
    "status": DiagnosticArray,
    "temperature": Temperature,
    "joint_states": JointState,
    "imu": Imu,
}
"""In the order in which messages of one stamp are sent: a status holds from its stamp on."""


class ReplayNode:
    """Plays a bag; see the module for its parameters."""

    def __init__(self) -> None:
        self.node = Node("replay")
        self.done = Future()
        declare = Declare(self.node)
        bag = Path(declare.text("bag", "", "rosbag2 folder or .mcap file"))
        self._speed = declare.number("speed", 0.0, "times real time; 0: as fast as credits allow", least=0.0)
        self._needed = declare.integer("consumers", 0, "credits to wait for before it starts", least=0)
        asked = [
            declare.text(f"{kind}_topic", "", f"{kind} topic in the bag; chosen by type when empty") or None
            for kind in ("imu", "status", "joint", "temperature")
        ]
        notes: list[str] = []
        chosen, raw = read_messages(bag, TopicChoice(*asked), notes)
        for note in notes:
            self.node.get_logger().info(note)
        topics = Topics(*(topic.lstrip("/") for topic in astuple(Topics())))  # relative: of the node's namespace
        found: dict[str, Sequence[bytes]] = {
            getattr(topics, kind): raw.get(getattr(chosen, kind), ()) for kind in _CLASSES
        }
        self._imu_topic = topics.imu
        self._queue = _merge(found, list(found))
        if len(found[topics.imu]) <= NOMINAL_FROM:
            raise DataError(f"{bag}: topic {chosen.imu} has only {len(found[topics.imu])} messages")
        self._first_ns = self._queue[0][0]
        self._end_ns = max(map(stamp_of, found[topics.imu]))
        self._next = 0
        self._born = time.monotonic()
        self._begun: float | None = None
        self._departed: float | None = None
        window = round(WINDOW_SAMPLES * (self._end_ns - stamp_of(found[topics.imu][0])) / len(found[topics.imu]))
        self._imu = Producer(self.node, Ticker(self.node), Imu, topics.imu, window_ns=window, on_credit=self._pump)
        self._others: dict[str, Any] = {
            topic: self.node.create_publisher(kind, topic, HISTORY if topic == topics.status else STREAM)
            for topic, kind in ((getattr(topics, name), kind) for name, kind in _CLASSES.items())
            if topic != topics.imu and found[topic]
        }
        self._timer = self.node.create_timer(TICK_S, self._pump)

    def close(self) -> None:
        """Nothing to leave behind."""

    def _everyone_is_here(self) -> bool:
        if not self._imu.heard_by(self._needed):
            return False
        watched = [p for topic, p in self._others.items() if not topic.endswith("joint_states")]
        matched = not self._needed or all(p.get_subscription_count() for p in watched)
        return matched or time.monotonic() - self._born > PEERS_PATIENCE_S

    def _pump(self) -> None:
        """Send what credits and the clock allow."""
        if self._begun is None:
            if not self._everyone_is_here():
                return
            self._begun = time.monotonic()
        for _ in range(BURST):
            if self._next >= len(self._queue):
                self._farewell()
                return
            stamp, topic, message = self._queue[self._next]
            if not self._imu.allows(stamp):
                return
            if self._speed > 0.0 and (stamp - self._first_ns) / NS > self._speed * (time.monotonic() - self._begun):
                return
            if topic == self._imu_topic:
                self._imu.publish(message, stamp)
            else:
                publish(self._others[topic], message)
            self._next += 1

    def _farewell(self) -> None:
        if self._departed is None:
            self._departed = time.monotonic()
            self._imu.end(self._end_ns)
        late = time.monotonic() - self._departed > FAREWELL_S
        if (self._imu.acknowledged or late) and not self.done.done():
            self.done.set_result(None)


def _merge(found: Mapping[str, Sequence[bytes]], order: list[str]) -> list[tuple[int, str, bytes]]:
    """All messages by stamp; at equal stamps in the order of topics, status before the samples it is about."""
    rank = {topic: k for k, topic in enumerate(order)}
    entries = [(stamp_of(message), topic, message) for topic, messages in found.items() for message in messages]
    entries.sort(key=lambda entry: (entry[0], rank[entry[1]]))
    return entries


def main() -> None:
    """Run the node."""
    run_node(ReplayNode)


if __name__ == "__main__":
    main()
