"""The console that verbs print to: names of files, topics and effects are shown as they are, never obeyed."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rich.console import Console, ConsoleOptions, ConsoleRenderable, RenderHook, RenderResult
from rich.segment import Segment

from sdimu_calibration.core.plain_text import printable

_PIPE_WIDTH = 140
"""Columns when it is unknown how wide the output is: a file or a pipe must not cut the table."""


def plain(**options: Any) -> Console:
    """Return a console that neither takes ``[names]`` for markup nor lets control characters through."""
    made = Console(markup=False, emoji=False, **options)
    made.push_render_hook(_Printable())
    return made


def console() -> Console:
    """Return a console that does not cut tables when its output goes to a file or a pipe."""
    made = plain()
    return made if made.is_terminal else plain(width=_PIPE_WIDTH)


class _Printable(RenderHook):
    """Lets what is printed through the filter below."""

    def process_renderables(self, renderables: list[ConsoleRenderable]) -> list[ConsoleRenderable]:
        """Wrap each; what rich itself sends to move the cursor has no text."""
        return [_Shown(renderable) for renderable in renderables]


class _Shown:
    """Something to print, without the control characters in its text."""

    def __init__(self, content: ConsoleRenderable) -> None:
        self._content = content

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the segments of the content; the colours are not in their text."""
        segments: Iterable[Segment] = console.render(self._content, options)
        for segment in segments:
            if segment.control:
                yield segment
            else:
                lines = "\n".join(map(printable, segment.text.split("\n")))
                yield Segment(lines, segment.style)
