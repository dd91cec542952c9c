"""What of a file from elsewhere an import does not take: said in one message, for a map that forgot it is no fault."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from sdimu_calibration.storage.importing.import_map import Column, ImportMap
from sdimu_calibration.storage.importing.import_stamps import Table

_SHOWN = 12
"""Number of columns that a message names: more do not fit into a line."""
_TAKES = "an import takes accel, gyro, time, temperature and phase, by the columns that the map names for them"


class Unused(NamedTuple):
    """What of a file is not used."""

    path: Path
    columns: tuple[str, ...]
    """Names, those of arrays with their sizes."""


def unused(tables: Sequence[Table], chart: ImportMap) -> list[Unused]:
    """Say of each file that a map describes which columns it does not name."""
    # Of several files each holds what the map names of it: a column of the same name in another one counts as used.
    named = _named(chart)
    left = [Unused(table.path, tuple(table.others(named))) for table in tables]
    return [one for one in left if one.columns]


def in_words(left: Iterable[Unused]) -> list[str]:
    """Write a message; files with the same columns share one."""
    paths: dict[tuple[str, ...], list[Path]] = {}
    for one in left:
        paths.setdefault(one.columns, []).append(one.path)
    return [_message(columns, those) for columns, those in paths.items()]


def _message(columns: Sequence[str], paths: Sequence[Path]) -> str:
    more = len(paths) - 1
    others = f" and {more} more file{'s' if more > 1 else ''}" if more else ""
    return f"{paths[0]}{others}: not used: {shown(columns)} ({_TAKES})"


def shown(columns: Sequence[str]) -> str:
    """List columns; of many the first ones, and how many more there are."""
    more = len(columns) - _SHOWN
    return ", ".join(columns[:_SHOWN]) + (f" and {more} more" if more > 0 else "")


def _named(chart: ImportMap) -> list[Column]:
    """Columns that a map names."""
    parts = (*chart.accel.columns, chart.accel.time, *chart.gyro.columns, chart.gyro.time)
    heat = (chart.temperature.column, chart.temperature.time) if chart.temperature else ()
    phase = (chart.phase.column,) if chart.phase else ()
    return [column for column in (*parts, chart.time.column, chart.time.counter, *heat, *phase) if column is not None]
