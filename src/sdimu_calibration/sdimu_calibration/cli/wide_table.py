"""A table for the terminal that wraps when the window is narrow and never cuts names or digits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console


def print_table(
    console: Console, headings: Sequence[str], lines: Sequence[Sequence[str]], title: str | None = None, left: int = 1
) -> None:
    """Print lines under headings; the first `left` columns and the last one are text, the others numbers."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(title=title, title_justify="left", pad_edge=False, box=SIMPLE_HEAD)
    for place, heading in enumerate(headings):
        width = max(len(text) for text in (heading, *(line[place] for line in lines)))
        is_text = place < left or place == len(headings) - 1
        table.add_column(heading, justify="left" if is_text else "right", min_width=width)
    for line in lines:
        table.add_row(*(text.replace("[", r"\[") for text in line))
    console.print(table, soft_wrap=True)
