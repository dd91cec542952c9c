"""A map for a file that came without one: from headings, units, ranges and rates, for the user to look at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.importing.column_scales import Scale, accel_scale, gyro_scale
from sdimu_calibration.storage.importing.columns import Pair, TimeColumn, pairs_by_heading, pairs_by_numbers, time_of
from sdimu_calibration.storage.importing.text_table import TextTable, check_file

_UNKNOWN_HZ = 100.0
"""Sample rate (Hz) that stands in a map of a file without times, to be corrected by the user."""


@dataclass(frozen=True)
class Proposal:
    """A map.

    Attributes
    ----------
    suffix : str
        For the names of its file and of the bag; empty where a file holds one IMU.
    words : tuple of str
        What was recognised by what, and what is left to the user.
    """

    suffix: str
    text: str
    words: tuple[str, ...]


def propose_maps(paths: Sequence[Path]) -> list[Proposal]:
    """Propose a map for each IMU in a file.

    Parameters
    ----------
    paths : sequence of Path
        Files of one form; the first one is looked at.
    """
    path = Path(paths[0])
    check_file(path)
    if path.suffix.lower() == ".npz":
        raise DataError(
            f"{path}: a map can be proposed for columns in text only: write one ({_PAGE}) and state it with --map"
        )
    table = TextTable(path)
    table.leave_out_broken()
    pairs, by = pairs_by_heading(table.headings), "their headings"
    numbers = _numbers(table)
    if not pairs:
        pairs, by = pairs_by_numbers(numbers), "their numbers: a triple of nearly constant length is the force"
    if not pairs:
        shown = ", ".join(table.headings[:12]) or f"{numbers.shape[1]} columns without headings"
        raise DataError(
            f"{path}: it is not clear which columns are the accelerometers and which the gyros ({shown}): write a map "
            f"({_PAGE}) and state it with --map"
        )
    time = time_of(table, numbers, pairs)
    return [_proposal(path, table, numbers, pair, time, (by, len(pairs))) for pair in pairs]


_PAGE = "doc/recordings.md, Import"


def _numbers(table: TextTable) -> Floats:
    """All columns as numbers; NaN where a column holds words.

    Returns
    -------
    ndarray, shape (n, k)
    """
    rows = len(table.texts(1))
    return np.column_stack([_column(table, column, rows) for column in range(1, table.width + 1)])


def _column(table: TextTable, column: int, rows: int) -> Floats:
    try:
        return table.floats([column])[:, 0]
    except DataError:
        return np.full(rows, np.nan)


def _proposal(
    path: Path, table: TextTable, numbers: Floats, pair: Pair, time: TimeColumn, found: tuple[str, int]
) -> Proposal:
    by, count = found
    f, w = numbers[:, list(pair.accel)], numbers[:, list(pair.gyro)]
    force = accel_scale(f, pair.accel_unit)
    rate_hz = time.rate_hz or _UNKNOWN_HZ
    rates = gyro_scale(w, f * force.factor, rate_hz, pair.gyro_unit)
    names = [_name(table, k) for k in (*pair.accel, *pair.gyro)]
    words = [
        f"{path}: accelerometers {', '.join(names[:3])} and gyros {', '.join(names[3:])}, by {by}",
        f"accelerometers: {force.why}",
        f"gyros: {rates.why}",
        f"time: {time.why}" + ("" if time.known else f"; rate_hz: {_UNKNOWN_HZ:g} stands in the map: correct it"),
        *table.notes,
    ]
    if count > 1:
        words.insert(0, f"{path}: {count} IMUs are in it, this is '{pair.name}'")
    lines = [
        "# Proposed by sdimu import; look at every line before you use it.",
        *(f"# {word}" for word in words),
        "format: sdimu-import/1",
        f"time: {time.text(rate_hz)}",
        *_sensor("accel", names[:3], force),
        *_sensor("gyro", names[3:], rates),
    ]
    return Proposal(f"_{pair.name}" if count > 1 else "", "\n".join(lines) + "\n", tuple(words))


def _name(table: TextTable, column: int) -> str:
    """Heading of a column, or its number where the heading does not name it alone."""
    heading = table.headings[column] if column < len(table.headings) else ""
    return heading if heading and table.headings.count(heading) == 1 else str(column + 1)


def _sensor(key: str, names: Sequence[str], scale: Scale) -> list[str]:
    columns = ", ".join(name if name.isdecimal() else f'"{name}"' for name in names)
    out = [f"{key}:", f"  columns: [{columns}]", f"  unit: {scale.unit}"]
    if scale.bias:
        out.append(f"  bias: {scale.bias:g}")
    if scale.counts != 1.0:
        out.append(f"  counts_per_unit: {scale.counts:g}")
    return out
