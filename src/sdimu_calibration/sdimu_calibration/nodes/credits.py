"""Flow control and end of stream over DDS, driven by header stamps.

RELIABLE + KEEP_ALL alone loses data when a reader is slow: the writer blocks at 5,000 unacknowledged
samples and then refuses. So consumers grant credits, and a simulated producer stays within a window of them.

=====================  ==========================================================================
``<topic>``            the data, whatever their type
``<topic>/credit``     std_msgs/Header, consumer to producer: stamp reached, frame_id = the consumer's full
                       node name. Stamp 0 says "ready, nothing received": the producer counts it as being level.
                       Sent every hundred samples, and repeated every 0.25 s unless samples wait in it.
``<topic>/end``        std_msgs/Header, latched, producer to consumers: stamp of the last message.
                       A consumer answers with a credit of that stamp once it holds everything.
=====================  ==========================================================================

Nothing here is needed to use a real driver: a consumer that never grants a credit never holds the
producer, and a consumer without a crediting producer just listens. A consumer that vanished is
forgotten when DDS has dropped it (the lease, 10 s with config/ros/fastdds.xml); one that stays idle at the same
stamp for five seconds although more was sent has lost it, and is counted as being level.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Header

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.nodes.stopping import asked_to_stop
from sdimu_calibration.nodes.ticking import Ticker

STREAM = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)
"""For everything that must not be lost."""
LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""The last message also reaches who comes later."""
HISTORY = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""The last thousand messages also reach who comes later; for slow topics."""

BLOCK = 100
"""Number of samples between credits, and of those that are decoded at once (1): half of what a producer sends ahead.
With 20 a whole test takes a quarter more of the processor. Slow streams do not wait for it: what has come is taken
every 0.05 s."""
REPEAT_S = 0.25
QUIET_REPEATS = 20
"""Number of repeated credits without data after which what was sent and has not come counts as lost: 5 s. A lost packet
is sent again at the writer's next heartbeat, up to 3 s later. Repeats are counted, not seconds: a node that was busy or
had no processor has not looked for data meanwhile."""
REFUSED_S = 120.0
"""Longest wait (s) for a subscriber that takes nothing: 20 s ended a test on a busy machine."""
TELL_REFUSED_S = 15.0
"""Time (s) after which such a wait is told: a killed subscriber is forgotten after 10 s."""
NO_LIMIT = 2**63 - 1
NS = 1_000_000_000


def to_ns(stamp: Any) -> int:
    """Nanoseconds of a builtin_interfaces/Time."""
    return int(stamp.sec) * NS + int(stamp.nanosec)


def stamp_of(message: bytes) -> int:
    """Stamp (ns) of the header with which a little-endian CDR message begins."""
    sec = int.from_bytes(message[4:8], "little", signed=True)
    return sec * NS + int.from_bytes(message[8:12], "little")


def header(stamp_ns: int, frame_id: str = "") -> Header:
    """Return a std_msgs/Header of a stamp in nanoseconds."""
    message = Header(frame_id=frame_id)
    message.stamp.sec, message.stamp.nanosec = divmod(int(stamp_ns), NS)
    return message


@dataclass
class _Peer:
    """A consumer as its producer sees it."""

    reached_ns: int | None
    """None: nothing was sent yet, level with the first stamp."""
    repeats: int = 0


class Producer:
    """Send one topic and stay at most a window ahead of every consumer that grants credits.

    Parameters
    ----------
    message_type : type
        ROS message class of the topic.
    window_ns : int
        How far (ns of stamps) the producer may be ahead; `NO_LIMIT` only does the end of stream.
    on_credit : callable or None
        Called after each credit: time to send more.
    patience_s : float
        A consumer that vanished is waited for so long: it may be started again and go on.
    """

    def __init__(
        self,
        node: Node,
        ticker: Ticker,
        message_type: type,
        topic: str,
        *,
        window_ns: int = NO_LIMIT,
        on_credit: Callable[[], None] | None = None,
        qos: QoSProfile = STREAM,
        patience_s: float = 0.0,
    ) -> None:
        self._node = node
        self._window_ns = window_ns
        self._on_credit = on_credit
        self._patience_s = patience_s
        self._peers: dict[str, _Peer] = {}
        self._missing: dict[str, float] = {}
        self._sent_ns: int | None = None
        self._end_ns: int | None = None
        self.publisher = node.create_publisher(message_type, topic, qos)
        topic = node.resolve_topic_name(topic)  # credits go where the data go, remapped or not
        self._end_publisher = node.create_publisher(Header, f"{topic}/end", LATCHED)
        self._credit = node.create_subscription(Header, f"{topic}/credit", self._take_credit, STREAM)
        ticker.every(0.5, self._forget_vanished)

    @property
    def consumers(self) -> int:
        """How many consumers have granted a credit and are still there."""
        return len(self._peers)

    def heard_by(self, needed: int) -> bool:
        """Whether so many consumers have granted a credit, and DDS has matched as many readers of the data.

        A credit may arrive before the writer of the data knows the reader: what is sent until then is lost.
        """
        return self.consumers >= needed and self.publisher.get_subscription_count() >= needed

    @property
    def limit_ns(self) -> int:
        """Stamp up to which messages may be sent now."""
        reached = [peer.reached_ns for peer in self._peers.values() if peer.reached_ns is not None]
        if not reached or self._window_ns == NO_LIMIT:
            return NO_LIMIT
        return min(reached) + self._window_ns

    def allows(self, stamp_ns: int) -> bool:
        """Whether a message of a stamp may be sent now: within the window, or the first after a pause in the data.

        Where every consumer holds all that was sent, no further credit would come to end the pause.
        """
        level = self._sent_ns is not None and all(
            peer.reached_ns is not None and peer.reached_ns >= self._sent_ns for peer in self._peers.values()
        )
        return level or stamp_ns <= self.limit_ns

    def publish(self, message: Any, stamp_ns: int) -> None:
        """Send a message (or its CDR bytes); wait while DDS refuses because a reader is slow or was killed."""
        publish(self.publisher, message)
        if self._sent_ns is None:
            for peer in self._peers.values():
                peer.reached_ns = stamp_ns
        self._sent_ns = stamp_ns

    def end(self, stamp_ns: int) -> None:
        """Say that `stamp_ns` was the last stamp."""
        self._end_ns = stamp_ns
        self._end_publisher.publish(header(stamp_ns, self._node.get_fully_qualified_name()))

    @property
    def acknowledged(self) -> bool:
        """True when the end was said and every consumer that is still there holds everything."""
        return self._end_ns is not None and all(
            peer.reached_ns is not None and peer.reached_ns >= self._end_ns for peer in self._peers.values()
        )

    def _take_credit(self, message: Header) -> None:
        reached = to_ns(message.stamp)
        if reached == 0:
            # Before the end "ready" means level; after it, the consumer has not yet heard of the end.
            level = self._sent_ns if self._end_ns is None else -1
            self._peers[message.frame_id] = _Peer(level)
        else:
            peer = self._peers.setdefault(message.frame_id, _Peer(reached))
            peer.repeats = peer.repeats + 1 if reached == peer.reached_ns else 0
            peer.reached_ns = reached
            if peer.repeats >= QUIET_REPEATS and self._sent_ns is not None and reached < self._sent_ns:
                peer.reached_ns, peer.repeats = self._sent_ns, 0
        if self._on_credit is not None:
            self._on_credit()

    def _forget_vanished(self) -> None:
        if not self._peers:
            return
        infos = self._node.get_publishers_info_by_topic(self._credit.topic_name)
        present = {f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in infos}
        now = time.monotonic()
        self._missing = {name: self._missing.get(name, now) for name in self._peers if name not in present}
        gone = [name for name, since in self._missing.items() if now - since >= self._patience_s]
        for name in gone:
            self._node.get_logger().warning(f"{name} has gone; no longer waiting for it")
            del self._peers[name], self._missing[name]
        if gone and self._on_credit is not None:
            self._on_credit()


def publish(publisher: Any, message: Any) -> None:
    """Publish; while DDS refuses (5,000 samples unacknowledged) try again for `REFUSED_S`.

    Raises
    ------
    DataError
        When a subscriber has taken nothing for so long: it hangs, or it was stopped.
    """
    begun = time.monotonic()
    told = False
    while not asked_to_stop():
        try:
            publisher.publish(message)
        except rclpy_implementation.RCLError as error:  # noqa: PERF203 (the loop is the retry)
            waited = time.monotonic() - begun
            if waited > REFUSED_S:
                raise DataError(f"{_refusal(publisher, waited)}; end the node that hangs, and start again") from error
            if waited > TELL_REFUSED_S and not told:
                get_logger("sdimu").warning(f"{_refusal(publisher, waited)}; waiting")
                told = True
        else:
            return


def _refusal(publisher: Any, waited_s: float) -> str:
    count = publisher.get_subscription_count()
    return f"{publisher.topic_name}: one of its {count} subscribers has taken nothing for {waited_s:.0f} s"


class Consumer:
    """Grant credits for one topic and watch for its end.

    Parameters
    ----------
    topic : str
        The data topic; the data subscription itself belongs to the caller.
    every : int
        Samples between credits.
    busy : callable
        True while samples are waiting inside the consumer; credits are then not repeated.
    on_end : callable or None
        Called when everything up to the end of a stream has been reached, once for each end; when some of it did not
        come in time (`QUIET_REPEATS`), once without it, and again if it comes after all.
    """

    def __init__(
        self,
        node: Node,
        ticker: Ticker,
        topic: str,
        *,
        every: int = BLOCK,
        busy: Callable[[], bool] = lambda: False,
        on_end: Callable[[], None] | None = None,
    ) -> None:
        self._name = node.get_fully_qualified_name()
        topic = node.resolve_topic_name(topic)
        self.topic = topic
        self._every = every
        self._busy = busy
        self._on_end = on_end
        self._reached_ns = 0
        self._count = 0
        self._open = False
        self._quiet = 0
        self._end_ns: int | None = None
        self.ended = False
        self._publisher = node.create_publisher(Header, f"{topic}/credit", STREAM)
        self._end = node.create_subscription(Header, f"{topic}/end", self._take_end, LATCHED)
        ticker.every(REPEAT_S, self._repeat)

    @property
    def reached_ns(self) -> int:
        """Latest stamp reached; 0 before the first."""
        return self._reached_ns

    def ready(self) -> None:
        """Start granting credits: what is slow at the start (compiling) is done."""
        if not self._open:
            self._open = True
            self._grant()

    def reached(self, stamp_ns: int, samples: int = 1) -> None:
        """Everything up to `stamp_ns` has been dealt with; `samples` more than at the last call."""
        # An end that was answered without these data is answered again.
        self.ended = self.ended and not (samples and self._short)
        self._reached_ns = max(self._reached_ns, stamp_ns)
        self._quiet = 0
        self._count += samples
        if self._count >= self._every:
            self._grant()
        self._check_end()

    @property
    def _short(self) -> bool:
        """Whether data before the end are missing."""
        return self._end_ns is not None and self._reached_ns < self._end_ns

    @property
    def _gave_up(self) -> bool:
        """Whether what is missing before the end has been awaited for long enough."""
        return self._short and self._quiet >= QUIET_REPEATS

    def _grant(self) -> None:
        self._count = 0
        if self._open:
            reached = self._end_ns if self._gave_up and self._end_ns is not None else self._reached_ns
            publish(self._publisher, header(reached, self._name))

    def _repeat(self) -> None:
        if self._busy():
            return
        # The end comes on another topic: data may still be on their way.
        self._quiet += 1
        self._check_end()
        self._grant()

    def restart(self) -> None:
        """Forget how far the stream had come: what follows is another one."""
        self._reached_ns = self._count = 0
        self._end_ns, self.ended = None, False
        self._grant()

    def _take_end(self, message: Header) -> None:
        end_ns = to_ns(message.stamp)
        self.ended = self.ended and end_ns == self._end_ns
        self._end_ns = end_ns
        self._quiet = 0
        self._check_end()

    def _check_end(self) -> None:
        if self.ended or self._end_ns is None or (self._short and not self._gave_up):
            return
        self.ended = True
        self._grant()
        if self._on_end is not None:
            self._on_end()
