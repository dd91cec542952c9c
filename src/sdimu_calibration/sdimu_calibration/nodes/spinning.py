"""The main function of every node: start, spin, stop on a signal, leave with an honest exit status."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import Protocol

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rich.console import Console

from sdimu_calibration.core.plain_text import one_line
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.nodes.stopping import asked_to_stop, watch_signals


class Spinnable(Protocol):
    """A node that knows when it is done."""

    node: Node
    done: Future

    def close(self) -> None:
        """Leave files complete; called on every way out."""


def run_node(make: Callable[[], Spinnable], args: Sequence[str] | None = None) -> None:
    """Make a node and spin it until it is done or asked to stop; never returns.

    `EventsExecutor` keeps the order of arrival across topics and costs a fifth of the others per message. Its
    plain ``spin()`` dispatches nothing and looks at no signal, hence the loop.

    Raises SystemExit: 0 when done or stopped by a signal, 1 on unusable data or options (one line on stderr).
    """
    watch_signals()
    rclpy.init(args=list(args) if args is not None else None, signal_handler_options=SignalHandlerOptions.NO)
    status = 0
    shell: Spinnable | None = None
    try:
        shell = make()
        executor = EventsExecutor()
        executor.add_node(shell.node)
        while not asked_to_stop() and not shell.done.done():
            executor.spin_until_future_complete(shell.done, 0.2)
        if shell.done.done():
            shell.done.result()
    except KeyboardInterrupt:
        pass
    except (DataError, OSError) as error:
        _say(error)
        status = 1
    finally:
        if shell is not None:
            status = max(status, _close(shell, quiet=status > 0))
        rclpy.try_shutdown()
    sys.exit(status)


def _close(shell: Spinnable, quiet: bool) -> int:
    """Close a node; 1 when it cannot leave its files complete, which is said unless an error was said before."""
    try:
        shell.close()
    except (DataError, OSError) as error:
        if not quiet:
            _say(error)
        return 1
    return 0


def _say(error: Exception) -> None:
    Console(stderr=True, soft_wrap=True, markup=False, highlight=False).print(one_line(str(error)))
