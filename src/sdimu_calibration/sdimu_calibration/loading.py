"""Programs while they load: a signal ends them at once, without a traceback, as it does once they run.

Loading takes a second or more. Python's own handler would raise KeyboardInterrupt in the middle of somebody else's
module. Nothing is open yet, so that the process may end where it is.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module

INTERRUPTED = 130
"""Exit status (1): of a command that Ctrl-C has ended, as shells have it, 128 and the number of SIGINT."""


@contextmanager
def ending_at_once() -> Iterator[None]:
    """Load what a command needs: Ctrl-C ends it with status 130."""
    before = signal.getsignal(signal.SIGINT)
    # A command in the background of a script is told to ignore Ctrl-C, and goes on doing so.
    if before is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, lambda *_: os._exit(INTERRUPTED))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def run_node_program(module: str) -> None:
    """Load the module of a node and run it: until it takes over SIGINT and SIGTERM, they end it with status 0.

    `module`: with a function ``main``, which takes over both signals (`nodes.stopping`).
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: os._exit(0))
    import_module(module).main()
