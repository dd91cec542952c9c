"""A map for a file that came without one: from headings, units, ranges and rates, for the user to look at."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.data.axes_and_units import AS_RECORDED
from sdimu_calibration.core.plain_text import one_line
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.importing.array_columns import array_columns
from sdimu_calibration.storage.importing.array_table import read_mat, read_npz
from sdimu_calibration.storage.importing.column_scales import Scale, accel_scale, gyro_scale
from sdimu_calibration.storage.importing.columns import Pair, changes, pairs_by_heading, sensors_by_heading
from sdimu_calibration.storage.importing.import_map import ISO
from sdimu_calibration.storage.importing.other_columns import Other, phase_of, temperature_of
from sdimu_calibration.storage.importing.text_table import TextTable, check_file, column_text
from sdimu_calibration.storage.importing.time_column import Table, TimeColumn, time_of
from sdimu_calibration.storage.importing.unnamed_columns import pairs_by_numbers
from sdimu_calibration.storage.importing.unused_columns import shown

_UNKNOWN_HZ = 100.0
"""Sample rate (Hz) that stands in a map of a file without times, to be corrected by the user."""
_MOST_WITHOUT = 0.1
"""Share of samples without a number in one of six columns that is told, and not in each file."""
_LARGEST = 1e100
"""Size of a number, in any unit, from which it is none that was measured: its square would be out of range."""
_LONGEST_SUFFIX = 40
"""Number of characters of a heading that go into the name of a file."""


@dataclass(frozen=True)
class Proposal:
    """A map."""

    suffix: str
    """For the names of its file and of the bag; empty where a file holds one IMU."""
    text: str
    words: tuple[str, ...]
    """What was recognised by what, and what is left to the user."""


def propose_maps(paths: Sequence[Path]) -> list[Proposal]:
    """Propose a map for each IMU in a file.

    `paths`: files of one form; the first one is looked at. Raises DataError where the file holds no columns of numbers,
    or they cannot be told.
    """
    path = Path(paths[0])
    check_file(path)
    table = _table(path)
    numbers = table.numbers()
    numbers[~(np.abs(numbers) < _LARGEST)] = np.nan
    pairs, by = _pairs(table, numbers)
    if not pairs:
        there = f"{_shown(table) or f'{numbers.shape[1]} columns without headings'}{_half(table)}"
        raise DataError(
            f"{path}: it is not clear which columns are the accelerometers and which the gyros ({there}): {_WRITE}"
        )
    taken = [k for pair in pairs for k in (*pair.accel, *pair.gyro)]
    suffixes = _suffixes([pair.name for pair in pairs])
    return [
        _proposal(table, numbers, pair, _time(table, numbers, pair, taken), (by, suffix))
        for pair, suffix in zip(pairs, suffixes, strict=True)
    ]


_PAGE = "doc/recordings.md, Import"
_WRITE = f"write a map ({_PAGE}) and name it by --map"
_ASK_PHASE = f"; if one of them says what is a rest, name it in the map, phase ({_PAGE})"


def _shown(table: Table) -> str:
    """Name what the user has to choose from."""
    return ", ".join(table.headings[:12]) if isinstance(table, TextTable) else table.contents


def _half(table: Table) -> str:
    """Say which of the two kinds of sensors is there where the other one is not."""
    accel, gyro = sensors_by_heading(table.headings)
    if bool(accel) == bool(gyro):
        return ""
    here, lacking = ("accelerometers", "gyros") if accel else ("gyros", "accelerometers")
    names = _listed([table.name_of(k) for k in (accel or gyro)[0].columns])
    return f"; {names} are {here}, and no columns are called {lacking}"


def _table(path: Path) -> Table:
    """Open a file as a table of columns."""
    kind = path.suffix.lower()
    arrays = read_npz(path) if kind == ".npz" else read_mat(path) if kind == ".mat" else None
    if arrays is not None:
        columns = array_columns(arrays)
        if columns is None:
            raise DataError(f"{path}: no variable is a log of a sensor (there are: {arrays.contents()}): {_WRITE}")
        return columns
    table = TextTable(path)
    table.leave_out_broken()
    return table


def _time(table: Table, numbers: Floats, pair: Pair, taken: Sequence[int]) -> TimeColumn:
    """Find the clock of the gyros: a timetable says it itself."""
    clock = _clock(table, pair.gyro[0])
    if not clock or isinstance(table, TextTable):
        return time_of(table, numbers, taken)
    rate_hz, dates = table.clock(clock)
    why = f"{clock}, {'dates' if dates else 'in s'}, by its timetable" + (f", {rate_hz:.5g} Hz" if rate_hz else "")
    return TimeColumn(clock, ISO if dates else "s", rate_hz, why)


def _clock(table: Table, column: int) -> str:
    """Name the times that a timetable gives a column, from 0; empty where there are none."""
    return "" if isinstance(table, TextTable) else table.clock_of(column)


def _pairs(table: Table, numbers: Floats) -> tuple[list[Pair], str]:
    """Find the sensors, and say by what."""
    accel, gyro = sensors_by_heading(table.headings)
    try:
        pairs = pairs_by_heading(table.headings, numbers, accel, gyro)
    except DataError as error:
        raise DataError(f"{table.path}: {error} ({_WRITE})") from error
    if pairs:
        return pairs, "their headings"
    rate_hz = time_of(table, numbers).rate_hz or _UNKNOWN_HZ
    by = "their numbers: a triple of nearly constant length is the force"
    return pairs_by_numbers(numbers, rate_hz, accel, gyro), by


def _suffixes(names: Sequence[str]) -> list[str]:
    """Make parts of names of files of the names of IMUs; none where there is one."""
    if len(names) == 1:
        return [""]
    clean = [re.sub(r"\W", "", name)[:_LONGEST_SUFFIX] for name in names]
    return [f"_{name}" if name and clean.count(name) == 1 else f"_imu{k}" for k, name in enumerate(clean, start=1)]


def _proposal(table: Table, numbers: Floats, pair: Pair, time: TimeColumn, found: tuple[str, str]) -> Proposal:
    by, suffix = found
    path = table.path
    names = [table.name_of(k) for k in (*pair.accel, *pair.gyro)]
    doubts = [*([pair.doubt] if pair.doubt else []), *_doubts(table, numbers, (*pair.accel, *pair.gyro))]
    f, w = numbers[:, list(pair.accel)], numbers[:, list(pair.gyro)]
    try:
        force = accel_scale(f, pair.accel_unit)
    except DataError as error:
        raise DataError(f"{path}: {error}") from error
    rate_hz = time.rate_hz or _UNKNOWN_HZ
    own = _clock(table, pair.accel[0])
    rates = gyro_scale(w, f * force.factor, rate_hz, pair.gyro_unit)
    others = _others(table, numbers, pair, time)
    left = table.others([*names, time.column, own, *(one.column for one in others.values())])
    words = [
        f"{path}: accelerometers {_listed(names[:3])} and gyros {_listed(names[3:])}, by {by}",
        f"accelerometers: {force.why}",
        f"gyros: {rates.why}",
        f"time: {time.why}" + ("" if time.known else f"; rate_hz: {_UNKNOWN_HZ:g} stands in the map: correct it"),
        *(f"{what}: {one.why}" for what, one in others.items()),
        *([f"{path}: not used: {shown(left)}{'' if 'phase' in others else _ASK_PHASE}"] if left else []),
        *doubts,
        *table.notes,
    ]
    if suffix:
        words.insert(0, f"{path}: several IMUs are in it, this is '{suffix[1:]}'")
    lines = [
        "# Proposed by sdimu import; look at every line before you use it.",
        *(f"# {one_line(word, None)}" for word in words),
        "format: sdimu-import/1",
        *(['decimal: ","'] if table.decimal == "," else []),
        f"time: {time.text(rate_hz)}",
        *_sensor("accel", names[:3], force),
        *([f"  time: {column_text(own)}"] if own not in ("", time.column) else []),
        *_sensor("gyro", names[3:], rates),
        *(one.line for one in others.values()),
    ]
    return Proposal(suffix, "\n".join(lines) + "\n", tuple(words))


def _others(table: Table, numbers: Floats, pair: Pair, time: TimeColumn) -> dict[str, Other]:
    """Find what a map can take beside the sensors and the times."""
    clock = [k for k in range(numbers.shape[1]) if table.name_of(k) == time.column]
    taken = [*pair.accel, *pair.gyro, *clock]
    found = {
        "phase": phase_of(table, table.rows(pair.gyro[0]), taken),
        "temperature": temperature_of(table, numbers, taken),
    }
    return {what: one for what, one in found.items() if one is not None}


def _doubts(table: Table, numbers: Floats, columns: Sequence[int]) -> list[str]:
    """Say what speaks against six columns; refuse those that hold hardly a number."""
    six, names = numbers[:, list(columns)], [table.name_of(k) for k in columns]
    without = int(np.count_nonzero(~np.isfinite(six).all(axis=1)))
    if 2 * without > len(six) or len(six) - without < 2:
        if isinstance(table, TextTable):
            # Where cells are no numbers this says which.
            table.floats(names)
        raise DataError(
            f"{table.path}: {len(six) - without} of {len(six)} lines hold a number in all of the columns "
            f"{_listed(names)}"
        )
    out = []
    if without > _MOST_WITHOUT * len(six):
        out.append(f"{without} of {len(six)} samples have no number in one of the six columns")
    fixed = [name for name, moves in zip(names, changes(six), strict=True) if not moves]
    if fixed:
        out.append(f"the numbers in {_listed(fixed)} never change: look whether they are measured")
    return out


def _listed(names: Sequence[int | str]) -> str:
    return ", ".join(map(str, names))


def _sensor(key: str, names: Sequence[int | str], scale: Scale) -> list[str]:
    out = [f"{key}:", f"  columns: [{', '.join(map(column_text, names))}]", f"  unit: {scale.unit}"]
    if scale.bias:
        out.append(f"  bias: {scale.bias:g}")
    if scale.counts != 1.0:
        out.append(f"  counts_per_unit: {scale.counts:g}")
    if scale.sign != AS_RECORDED:
        out.append(f"  sign: [{_listed(scale.sign)}]")
    return out
