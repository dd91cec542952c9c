"""The console that verbs print to."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

_PIPE_WIDTH = 140
"""Columns when it is unknown how wide the output is: a file or a pipe must not cut the table."""


def console() -> Console:
    """Return a console that does not cut tables when its output goes to a file or a pipe."""
    from rich.console import Console

    made = Console()
    return made if made.is_terminal else Console(width=_PIPE_WIDTH)
