"""A subscription that takes what is offered: reliable from our own nodes, best effort from many IMU drivers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from sdimu_calibration.nodes.credits import STREAM
from sdimu_calibration.nodes.ticking import Ticker

BEST_EFFORT = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)

LATE = QoSProfile(
    history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
"""Also what was sent before, as far as the publisher keeps it."""


class Listener:
    """Subscribe reliably, and fall back to best effort when a publisher offers no more.

    A reliable subscription gets nothing at all from a best-effort publisher; a best-effort one would lose
    messages of a reliable publisher that it need not lose.

    Parameters
    ----------
    callback : callable
        Takes the message, as CDR bytes when `raw`.
    late : bool
        Ask first for what was sent before this subscription (a node that goes on where it was killed).
    """

    def __init__(
        self,
        node: Node,
        ticker: Ticker,
        message_type: type,
        topic: str,
        callback: Callable[[Any], None],
        *,
        raw: bool = False,
        late: bool = False,
    ) -> None:
        self._node = node
        self._arguments = (message_type, topic, callback)
        self._raw = raw
        self._refused = False
        self._fall_to = [STREAM, BEST_EFFORT] if late else [BEST_EFFORT]
        self._subscription = self._subscribe(LATE if late else STREAM)
        # Not from inside the event: the subscription must not vanish under its own callback.
        ticker.every(0.2, self._fall_back)

    def _subscribe(self, qos: QoSProfile) -> Subscription:
        events = SubscriptionEventCallbacks(incompatible_qos=self._take_refusal)
        return self._node.create_subscription(*self._arguments, qos, raw=self._raw, event_callbacks=events)

    def _take_refusal(self, _: Any) -> None:
        self._refused = True

    def _fall_back(self) -> None:
        if not self._refused:
            return
        self._refused = False
        if not self._fall_to:
            return
        topic, qos = self._subscription.topic_name, self._fall_to.pop(0)
        if qos is BEST_EFFORT:
            self._node.get_logger().warning(f"{topic} is offered as best effort only; what is lost will be counted")
        old, self._subscription = self._subscription, self._subscribe(qos)
        self._node.destroy_subscription(old)
