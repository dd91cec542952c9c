"""The console that verbs print to: names of files, topics and effects are shown as they are, never obeyed."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import typer
from rich.console import Console, ConsoleOptions, ConsoleRenderable, RenderHook, RenderResult
from rich.segment import Segment

from sdimu_calibration.core.plain_text import one_line, printable

_PIPE_WIDTH = 140
"""Columns when it is unknown how wide the output is: a file or a pipe must not cut the table."""


def plain(**options: Any) -> Console:
    """Return a console that neither takes ``[names]`` for markup nor lets control characters through."""
    made = Console(markup=False, emoji=False, **options)
    made.push_render_hook(_Printable())
    return made


def say(console: Console, text: str) -> None:
    """Print a line: wrapped between words in a terminal, whole in a pipe, so that it can be searched.

    Spaces before the first word stay: they say that the line belongs to the one above.
    """
    indent = " " * (len(text) - len(text.lstrip(" ")))
    _wrapped(console, indent + one_line(text, None), f"{indent}  ")


def pair(console: Console, name: str, text: str, width: int) -> None:
    """Print a name and what is said of it, below the names and texts of other pairs.

    `width`: characters of the longest name.
    """
    before = f"  {one_line(name, None):{width}}  "
    _wrapped(console, before + one_line(text, None), " " * len(before))


def _wrapped(console: Console, line: str, indent: str) -> None:
    """Print a line; in a terminal the lines that it is wrapped into begin with `indent`."""
    if console.is_terminal:
        line = textwrap.fill(
            line, console.width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
        )
    console.print(line, soft_wrap=True, highlight=False)


def command(console: Console, text: str) -> None:
    """Print a command to paste, as `shell_words.joined` writes it: on a line of its own, which is never broken."""
    console.print(f"  {printable(text)}", soft_wrap=True, highlight=False)


def answer(content: Path | Mapping[str, Any], asked: bool) -> None:
    """Print the answer on stdout where ``--json`` asks for it: a file as it is, or what one would hold."""
    if not asked:
        return
    if isinstance(content, Path):
        typer.echo(content.read_text(encoding="utf-8"), nl=False)
    else:
        from sdimu_calibration.storage.files.json_file import json_text

        typer.echo(json_text(content))


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
