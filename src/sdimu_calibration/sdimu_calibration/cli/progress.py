"""A progress bar for what takes more than a moment."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import Progress

_PATIENCE_S = 2.0


@contextmanager
def bar(console: Console) -> Iterator[Callable[[str, float], None]]:
    """Show a bar once two seconds have passed and the work is not done.

    Gives ``progress(word, fraction)`` with what is being done and the share done (0 to 1).
    """
    start = time.monotonic()
    shown = Progress(console=console, transient=True, disable=not console.is_terminal)
    task = shown.add_task("", total=1.0)

    def update(word: str, fraction: float) -> None:
        if time.monotonic() - start > _PATIENCE_S:
            shown.start()  # starting again does nothing
        shown.update(task, completed=fraction, description=word)

    try:
        yield update
    finally:
        shown.stop()
