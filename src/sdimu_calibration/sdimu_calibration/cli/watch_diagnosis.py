"""The live diagnosis in the terminal: where the model fails, what would explain it, how far the error fell."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.report.live_text import SeenDiagnosis

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.text import Text

_NOTABLE = 3.0
"""Sigmas from which a cell has a number."""
_FULL = 8.0
"""Sigmas from which a cell is bold."""
_MOST_STOPS = 16
_MOST_RANKED = 8


def picture(seen: SeenDiagnosis) -> RenderableType:
    """Return heat map, ranking and ladder, as far as there is a diagnosis."""
    from rich.console import Group
    from rich.text import Text

    if seen.stop < 0:
        return Text("no diagnosis yet", style="dim")
    style = "dim" if not seen.ladder else "green" if seen.verdict == Verdict.CONSISTENT else "bold yellow"
    head = Text(f"diagnosis of stop {seen.stop}: {seen.sentence}", style=style)
    return Group(head, _heat_map(seen), _tables(seen)) if seen.ladder else head


def _heat_map(seen: SeenDiagnosis) -> RenderableType:
    """Mean innovation in sigmas, channel by stop, the last stops that there is room for."""
    from rich.table import Table

    table = Table.grid(padding=(0, 1))
    first = max(0, len(seen.stops) - _MOST_STOPS)
    for _ in range(1 + len(seen.stops) - first):
        table.add_column(justify="right", min_width=3)
    table.add_row("mean innovation, sigma", *seen.stops[first:], style="dim")
    for channel, row in zip(seen.channels, seen.heat, strict=True):
        table.add_row(channel.replace("_", " "), *(_cell(value) for value in row[first:]))
    return table


def _cell(value: float) -> Text:
    from rich.text import Text

    if not np.isfinite(value):
        return Text("")
    if abs(value) < _NOTABLE:
        return Text("\N{MIDDLE DOT}", style="dim")
    colour = "red" if value > 0.0 else "blue"
    return Text(f"{value:+.0f}", style=f"bold {colour}" if abs(value) >= _FULL else colour)


def _tables(seen: SeenDiagnosis) -> RenderableType:
    from rich.table import Table

    beside = Table.grid(padding=(0, 4))
    beside.add_row(
        _rows(f"candidates, {seen.reaches}", seen.ranking[:_MOST_RANKED]),
        _rows("error with one stop left out", seen.ladder),
    )
    return beside


def _rows(title: str, rows: tuple[tuple[str, str], ...]) -> RenderableType:
    from rich.table import Table

    table = Table.grid(padding=(0, 2))
    table.add_row(title, style="dim")
    for row in rows:
        table.add_row(*row)
    return table
