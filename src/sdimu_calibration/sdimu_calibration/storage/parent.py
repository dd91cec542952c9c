"""Processes that work for another one end with it, also where that is killed and cannot tell them."""

from __future__ import annotations

import os
import threading
import time

_WATCHED_S = 0.5
"""Time (s) after which a process looks whether its parent is there."""


def end_with(parent: int) -> None:
    """Let this process end when its parent has ended: nobody takes what it works on.

    `parent`: number of the process that started this one.
    """

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_WATCHED_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True, name="parent").start()
