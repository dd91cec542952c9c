"""A table for the terminal that fits its width: names and digits are never cut."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from sdimu_calibration.cli.console import pair, say

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table


def print_table(
    console: Console, headings: Sequence[str], lines: Sequence[Sequence[str]], title: str | None = None, left: int = 1
) -> None:
    """Print lines under headings; the first `left` columns and the last one are text, the others numbers.

    A column that no line fills is left out. Where the window is narrow, headings are broken between words, then columns
    stand closer; where that is not enough, each line becomes a paragraph.
    """
    kept = [place for place in range(len(headings)) if place < left or any(line[place] for line in lines)]
    words = [place < left or place == len(headings) - 1 for place in kept]
    headings, lines = [headings[k] for k in kept], [[line[k] for k in kept] for line in lines]
    # A sign of per cent stays with its number.
    broken = [re.sub(" (?!%)", "\n", heading) for heading in headings]
    for heads, gap in ((headings, 1), (broken, 1), (broken, 0)):
        widths = [
            max(len(text) for text in (*head.split("\n"), *(line[place] for line in lines)))
            for place, head in enumerate(heads)
        ]
        if sum(widths) + (2 * gap + 1) * (len(widths) - 1) + 2 <= console.width:
            # Nothing has to be wrapped, so nothing may be cut.
            console.print(_table(heads, widths, lines, title, words, gap), soft_wrap=True)
            return
    _paragraphs(console, headings, lines, title)


def _table(
    headings: Sequence[str],
    widths: Sequence[int],
    lines: Sequence[Sequence[str]],
    title: str | None,
    words: Sequence[bool],
    gap: int,
) -> Table:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(title=title, title_justify="left", pad_edge=False, box=SIMPLE_HEAD, padding=(0, gap, 0, gap))
    for place, heading in enumerate(headings):
        table.add_column(heading, justify="left" if words[place] else "right", min_width=widths[place])
    for line in lines:
        table.add_row(*(text.replace("[", r"\[") for text in line))
    return table


def _paragraphs(console: Console, headings: Sequence[str], lines: Sequence[Sequence[str]], title: str | None) -> None:
    """Print each line as its name, and below it what each column says."""
    if title:
        say(console, title)
    indent = max(map(len, headings[1:]), default=0)
    for line in lines:
        say(console, line[0])
        for heading, text in zip(headings[1:], line[1:], strict=True):
            if text:
                pair(console, heading, text, indent)
