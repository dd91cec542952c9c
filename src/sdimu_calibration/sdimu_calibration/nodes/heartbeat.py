"""A heartbeat on /diagnostics: the node is alive, and whether samples come; for diagnostic_aggregator.

The diagnostics of the data have stamps of the data and come as fast as they do. The heartbeat alone goes by the wall
clock: a node that waits still beats.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from sdimu_calibration.nodes.credits import header
from sdimu_calibration.nodes.ticking import Ticker

MARK = b": heartbeat"
"""In the bytes of every heartbeat: a recording leaves them out, they are not of the time of its data."""
SILENT_S = 5.0
"""Wall time (s) without new samples after which the heartbeat warns."""


class Heartbeat:
    """Beats once a period.

    Parameters
    ----------
    publisher : Publisher
        Of diagnostic_msgs/DiagnosticArray.
    period_s : float
        Wall time; 0 never beats.
    reached : callable
        Newest stamp (ns) of the data, 0 or less before the first.
    """

    def __init__(self, node: Node, ticker: Ticker, publisher: Any, period_s: float, reached: Callable[[], int]) -> None:
        self.name = node.get_fully_qualified_name().lstrip("/")
        """Name of the node as diagnostics carry it: with its namespace, so that two IMUs stay apart."""
        self._node, self._publisher, self._reached = node, publisher, reached
        self._last, self._moved = 0, time.monotonic()
        if period_s > 0.0:
            ticker.every(period_s, self._beat)

    def _beat(self) -> None:
        reached, now = self._reached(), time.monotonic()
        if reached != self._last:
            self._last, self._moved = reached, now
        quiet = now - self._moved
        level, text = DiagnosticStatus.OK, "samples come"
        if reached <= 0:
            level, text = DiagnosticStatus.WARN, "no samples have come yet"
        elif quiet > SILENT_S:
            level, text = DiagnosticStatus.WARN, f"no new samples for {quiet:.0f} s"
        status = DiagnosticStatus(level=level, name=f"{self.name}: heartbeat", message=text, hardware_id="imu")
        status.values = [KeyValue(key="reached_ns", value=str(max(reached, 0)))]
        stamp = self._node.get_clock().now().nanoseconds
        self._publisher.publish(DiagnosticArray(header=header(stamp), status=[status]))
