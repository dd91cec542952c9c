"""Node that records every topic in and out to one rosbag2 bag in MCAP, filed under header stamps.

Parameters: out (folder of the bag), topics (list of NAME=TYPE; the default is every topic in and out), replace.
Messages are written as they came, undecoded. The file is flushed every 0.25 s, so that a kill costs less than a
second. The recorder grants credits like any consumer and leaves when the streams of `STREAMS` have ended.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from rclpy.node import Node
from rclpy.task import Future

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.nodes.credits import Consumer, stamp_of
from sdimu_calibration.nodes.heartbeat import MARK
from sdimu_calibration.nodes.listening import Listener
from sdimu_calibration.nodes.parameters import Declare
from sdimu_calibration.nodes.spinning import run_node
from sdimu_calibration.nodes.ticking import Ticker
from sdimu_calibration.nodes.transform_type import TYPE_NAME as TRANSFORM_TYPE
from sdimu_calibration.nodes.transform_type import transform_class
from sdimu_calibration.nodes.transforms import STATIC, TRANSFORMS, stamp_of_first
from sdimu_calibration.storage.bags.mcap_bag import McapBag

DIAGNOSTICS = "/diagnostics"
TOPICS = (
    "imu/data_raw=sensor_msgs/msg/Imu",
    "imu/temperature=sensor_msgs/msg/Temperature",
    "rate_table/status=diagnostic_msgs/msg/DiagnosticArray",
    "rate_table/joint_states=sensor_msgs/msg/JointState",
    "rate_table/joint_trajectory=trajectory_msgs/msg/JointTrajectory",
    "rate_table/goal_status=diagnostic_msgs/msg/DiagnosticArray",
    "adaptive/choice=diagnostic_msgs/msg/DiagnosticArray",
    "calibration/coefficients=sensor_msgs/msg/JointState",
    "calibration/covariance=std_msgs/msg/Float64MultiArray",
    "calibration/navigation=nav_msgs/msg/Odometry",
    "calibration/diagnosis=diagnostic_msgs/msg/DiagnosticArray",
    "calibration/ranking=sensor_msgs/msg/JointState",
    "calibration/picture=sensor_msgs/msg/CompressedImage",
    "calibration/heat_map=std_msgs/msg/Float64MultiArray",
    "calibration/estimates=diagnostic_msgs/msg/DiagnosticArray",
    f"{DIAGNOSTICS}=diagnostic_msgs/msg/DiagnosticArray",
    f"{TRANSFORMS}={TRANSFORM_TYPE}",
    f"{STATIC}={TRANSFORM_TYPE}",
)
STREAMS = ("imu/data_raw", "rate_table/status", "calibration/coefficients")
"""Topics with an end; the first must end, the others must have ended or lost their publisher."""

FLUSH_S = 0.25
QUIET_S = 0.4
PEERS_PATIENCE_S = 5.0
_STAMP_LABEL = re.compile(rb"stamp_ns=(-?\d+)")


class RecorderNode:
    """Writes topics to a bag; see the module for its parameters."""

    def __init__(self) -> None:
        self.node = Node("recorder")
        self.done = Future()
        declare = Declare(self.node)
        out = Path(declare.text("out", "bag", "folder of the bag"))
        topics = declare.texts("topics", TOPICS, "topics to record, NAME=TYPE; relative names are of the namespace")
        replace = declare.flag("replace", False, "replace a bag that is there")
        needed = declare.texts("wait_for", [], "topics whose publishers to wait for, at most 5 s")
        self._needed = [self._name(topic) for topic in needed]
        self._bag = McapBag(out, replace=replace, live=True)
        self._born = self._latest = time.monotonic()
        self._ticker = Ticker(self.node)
        self._consumers = {self._name(topic): Consumer(self.node, self._ticker, topic) for topic in STREAMS}
        self._listeners: list[Listener] = []
        for text in topics:
            name, _, type_name = text.partition("=")
            self._record(self._name(name), type_name)
        self._bag.flush()
        self._ticker.every(FLUSH_S, self._tick)

    def _name(self, topic: str) -> str:
        """Return the whole name of a topic, as the bag has it: with the namespace, remapped."""
        return str(self.node.resolve_topic_name(topic))

    def close(self) -> None:
        """Finish the bag."""
        self._bag.close()

    def _record(self, name: str, type_name: str) -> None:
        self._bag.topic(name, type_name)
        take = self._writer(name, type_name)
        # Messages that are sent once and kept for late subscribers need their own QoS.
        kind, late = message_class(type_name), name == STATIC
        self._listeners.append(Listener(self.node, self._ticker, kind, name, take, raw=True, late=late))

    def _writer(self, name: str, type_name: str) -> Callable[[bytes], None]:
        """Return the callback of a topic, with everything it needs bound: it runs for every message."""
        stamp = stamp_in_label if type_name.endswith("MultiArray") else stamp_of
        if type_name == TRANSFORM_TYPE:
            stamp = stamp_of_first
        write = self._bag.write
        consumer = self._consumers.get(name)

        def take(message: bytes) -> None:
            if name == DIAGNOSTICS and MARK in message:
                return
            at = stamp(message)
            try:
                write(name, message, at)
            except DataError as error:
                self._fail(error)
            self._latest = time.monotonic()
            if consumer is not None:
                consumer.reached(at)

        return take

    def _fail(self, error: DataError) -> None:
        """Leave with an error; raised in a callback it would come out as a trace of the executor."""
        if not self.done.done():
            self.done.set_exception(error)

    def _tick(self) -> None:
        try:
            self._bag.flush()
        except DataError as error:
            self._fail(error)
        now = time.monotonic()
        if now - self._born > PEERS_PATIENCE_S or all(self.node.count_publishers(t) for t in self._needed):
            for consumer in self._consumers.values():
                consumer.ready()
        if self._complete() and now - self._latest > QUIET_S and not self.done.done():
            self.done.set_result(None)

    def _complete(self) -> bool:
        first, *others = self._consumers.values()
        return first.ended and all(c.ended or not self.node.count_publishers(c.topic) for c in others)


def stamp_in_label(message: bytes) -> int:
    """Stamp (ns) in the label ``stamp_ns=...`` of a CDR multi-array; 0 without one."""
    found = _STAMP_LABEL.search(message)
    return int(found.group(1)) if found else 0


def message_class(type_name: str) -> type:
    """Return the class of a type name such as ``sensor_msgs/msg/Imu``; DataError when it is not installed."""
    package, _, rest = type_name.partition("/")
    try:
        if type_name == TRANSFORM_TYPE:
            return transform_class()
        module = import_module(f"{package}.msg")
        return getattr(module, rest.rpartition("/")[2])  # type: ignore[no-any-return]
    except (ImportError, AttributeError) as error:
        raise DataError(f"topics: message type '{type_name}' is not installed") from error


def main() -> None:
    """Run the node."""
    run_node(RecorderNode)


if __name__ == "__main__":
    main()
