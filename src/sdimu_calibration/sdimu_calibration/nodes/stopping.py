"""SIGINT and SIGTERM as a flag, looked at between callbacks.

The handlers of rclpy shut the context down at once, and Python's raise KeyboardInterrupt wherever the program is;
inside `EventsExecutor` that surfaces as a RuntimeError of its C++ half. A flag leaves every callback whole.
"""

from __future__ import annotations

import signal
from types import FrameType

_asked = False


def watch_signals() -> None:
    """Take over SIGINT and SIGTERM in the main thread."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _ask)


def asked_to_stop() -> bool:
    """Return True once a signal has come."""
    return _asked


def _ask(_number: int, _frame: FrameType | None) -> None:
    global _asked  # noqa: PLW0603 (a signal belongs to the process)
    if _asked:
        raise KeyboardInterrupt  # asked twice: do not wait for a long computation
    _asked = True
