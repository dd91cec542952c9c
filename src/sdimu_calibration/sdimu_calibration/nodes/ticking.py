"""One timer for all the small periodic chores of a node: rclpy warns about, and pays for, many timers."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from rclpy.node import Node

PERIOD_S = 0.05


@dataclass
class _Chore:
    period_s: float
    action: Callable[[], None]
    due: float


class Ticker:
    """Calls chores at their periods (wall time), with a resolution of `PERIOD_S`."""

    def __init__(self, node: Node) -> None:
        self._chores: list[_Chore] = []
        self._timer = node.create_timer(PERIOD_S, self._tick)

    def every(self, period_s: float, action: Callable[[], None]) -> None:
        """Call `action` every `period_s` seconds from now on."""
        self._chores.append(_Chore(period_s, action, time.monotonic() + period_s))

    def _tick(self) -> None:
        now = time.monotonic()
        for chore in self._chores:
            if now >= chore.due:
                chore.due = now + chore.period_s
                chore.action()
