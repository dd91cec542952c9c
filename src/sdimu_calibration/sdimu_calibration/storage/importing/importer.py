"""Files from elsewhere (CSV, MAT, NPZ) to the samples of an IMU, as a map says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from pathlib import Path

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.data.resample import mean_over, same_stamps
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags.bag_writer import BagContent, write_recording
from sdimu_calibration.storage.importing.array_table import BinaryTable, read_mat, read_npz
from sdimu_calibration.storage.importing.import_map import ImportMap, PhaseMap, SensorMap, TemperatureMap, is_rest
from sdimu_calibration.storage.importing.import_stamps import Stamps, Table, lone_stamps, read_stamps, set_back
from sdimu_calibration.storage.importing.text_table import TextTable, check_file
from sdimu_calibration.storage.importing.unused_columns import Unused, in_words, unused

_KELVIN = 273.15
APART_NS = 60_000_000_000
"""Distance (ns) of recordings whose times begin again: long enough to be a gap for every estimate."""


@dataclass(frozen=True)
class Imported:
    """Samples as a bag holds them."""

    ns: Stamps
    """Shape (n,). Stamps (ns since 1970), as the file has them: gaps, jitter and repetitions stay."""
    omega_ib_b: Floats
    f_ib_b: Floats
    """`omega_ib_b`, `f_ib_b`: shape (n, 3). rad/s, m/s^2; NaN where the file says so."""
    temperature: tuple[Stamps, Floats] | None
    """Stamps (ns), deg C."""
    notes: tuple[str, ...]
    """What was done beyond copying."""
    status: Status | None = None
    """Where a column says what is a rest."""
    unused: tuple[Unused, ...] = ()
    """Of each file what the map does not name."""

    def later(self, by_ns: int) -> Imported:
        """Return the same samples at later times."""
        heat = self.temperature and (self.temperature[0] + by_ns, self.temperature[1])
        status = self.status and (self.status[0] + by_ns, *self.status[1:])
        return replace(self, ns=self.ns + by_ns, temperature=heat, status=status)


def read_files(paths: Sequence[Path], chart: ImportMap) -> Imported:
    """Read the files that a map describes.

    `paths`: CSV (or any columns in text), MAT, NPZ, bare numbers. Several files hold the parts that the map names, or,
    where it names none, one stretch of time each, in this order.
    """
    named = (
        chart.accel.file,
        chart.gyro.file,
        chart.temperature.file if chart.temperature else None,
        chart.phase.file if chart.phase else None,
    )
    if len(paths) > 1 and not any(named):
        found = _in_a_row([_read([path], chart) for path in paths], [Path(path) for path in paths])
    else:
        found = _read(paths, chart)
    return replace(found, notes=(*found.notes, *in_words(found.unused)))


def _read(paths: Sequence[Path], chart: ImportMap) -> Imported:
    """Read the files that hold one stretch of time together; a few broken lines are left out."""
    tables = [_open(Path(path), chart) for path in paths]
    try:
        return _together(tables, chart)
    except DataError:
        texts = [table for table in tables if isinstance(table, TextTable)]
        clock = chart.time.column is None and chart.time.counter is None
        if not [table for table in texts if table.leave_out_broken(as_nan=clock)]:
            raise
    return _together(tables, chart)


def _together(tables: list[Table], chart: ImportMap) -> Imported:
    """Read what one stretch of time holds."""
    _refuse_twice(tables, chart)
    accel_ns, f_ib_b, told = _sensor(tables, chart, chart.accel, "accel")
    gyro_ns, omega_ib_b, more = _sensor(tables, chart, chart.gyro, "gyro")
    notes = [note for table in tables if isinstance(table, TextTable) for note in table.notes]
    notes += dict.fromkeys((*told, *more))
    if not same_stamps(gyro_ns, accel_ns):
        gyro_ns, omega_ib_b, f_ib_b, note = _joined(gyro_ns, omega_ib_b, accel_ns, f_ib_b)
        notes.append(note)
    temperature = None if chart.temperature is None else _temperature(tables, chart, chart.temperature)
    status = None if chart.phase is None else _status(tables, chart, chart.phase)
    return Imported(gyro_ns, omega_ib_b, f_ib_b, temperature, tuple(notes), status, tuple(unused(tables, chart)))


def _refuse_twice(tables: list[Table], chart: ImportMap) -> None:
    """Refuse a map that takes one column for two things."""
    taken: dict[tuple[Path, int | str], str] = {}

    def take(table: Table, column: int | str | None, name: str) -> None:
        if column is None:
            return
        try:
            place = table.place(column)
        except DataError as error:
            raise DataError(f"{error}; the map names it for {name}") from error
        first = taken.setdefault((table.path, place), name)
        if first != name:
            raise DataError(f"import map: {first} and {name} both name column '{column}' of {table.path}")

    for what, part in (("accel", chart.accel), ("gyro", chart.gyro)):
        table = _chosen(tables, part.file, what)
        for axis, column in zip("xyz", part.columns, strict=False):
            take(table, column, f"{what} {axis}")
        take(table, part.time if part.time is not None else chart.time.column, "time")
    if chart.phase is not None:
        take(_chosen(tables, chart.phase.file, "phase"), chart.phase.column, "phase")
    if chart.temperature is not None:
        take(_chosen(tables, chart.temperature.file, "temperature"), chart.temperature.column, "temperature")


def _in_a_row(parts: Sequence[Imported], paths: Sequence[Path]) -> Imported:
    """Put recordings of one test one after the other, each apart from the one before where its times begin again."""
    moved, notes = [parts[0]], list(parts[0].notes)
    for part, path in zip(parts[1:], paths[1:], strict=True):
        end = int(moved[-1].ns.max())
        if int(part.ns.min()) > end:
            moved.append(part)
        else:
            moved.append(part.later(end + APART_NS - int(part.ns.min())))
            notes.append(
                f"{path}: its times begin again, so it is put {APART_NS * 1e-9:.0f} s after the file before; what "
                "happened between the two is taken as unknown"
            )
        notes += part.notes
    heat = [part.temperature for part in moved if part.temperature is not None]
    return Imported(
        np.concatenate([part.ns for part in moved]),
        np.concatenate([part.omega_ib_b for part in moved]),
        np.concatenate([part.f_ib_b for part in moved]),
        (np.concatenate([ns for ns, _ in heat]), np.concatenate([value for _, value in heat])) if heat else None,
        tuple(notes),
        _one_status([part.status for part in moved if part.status is not None]),
        tuple(one for part in parts for one in part.unused),
    )


def _one_status(parts: Sequence[Status]) -> Status | None:
    """Put the phases of several files one after the other, and count the stops on."""
    if not parts:
        return None
    ns, dwell, stop = (np.concatenate(column) for column in zip(*parts, strict=True))
    edges = dwell & np.concatenate([[True], ~dwell[:-1] | (np.diff(stop) != 0)])
    return ns, dwell, np.maximum(np.cumsum(edges) - 1, 0).astype(np.int64)


def write_imported(path: Path, found: Imported, replace: bool = False, custom: Mapping[str, str] | None = None) -> None:
    """Write imported samples to a rosbag2 folder.

    `replace`: replace a bag that is there; `custom`: what the user says of the unit: ``serial``, ``power_on``.
    """
    write_recording(
        path,
        BagContent(
            start_ns=0,
            imu_ns=found.ns,
            omega_ib_b=found.omega_ib_b,
            f_ib_b=found.f_ib_b,
            temperature=found.temperature,
            status=found.status,
        ),
        replace=replace,
        custom=custom,
    )


def _open(path: Path, chart: ImportMap) -> Table:
    check_file(path)
    kind = path.suffix.lower()
    if kind == ".npz":
        return read_npz(path)
    arrays = read_mat(path) if kind == ".mat" else None
    if arrays is None and chart.binary is not None:
        return BinaryTable(path, chart.binary)
    return arrays or TextTable(path, chart.delimiter, chart.decimal, chart.skip_lines)


def _chosen(tables: list[Table], pattern: str | None, what: str) -> Table:
    """Find the file that holds something."""
    names = ", ".join(str(table.path) for table in tables)
    if pattern is None:
        if len(tables) > 1:
            raise DataError(f"import map: {what}.file: which of {names}? (a pattern such as '*_{what}.csv')")
        return tables[0]
    fitting = [table for table in tables if fnmatch(table.path.name, pattern)]
    if len(fitting) != 1:
        number = "none" if not fitting else f"{len(fitting)}"
        raise DataError(f"import map: {what}.file: '{pattern}' fits {number} of the files {names}; expected one")
    return fitting[0]


def _sensor(
    tables: list[Table], chart: ImportMap, part: SensorMap, what: str
) -> tuple[Stamps, Floats, tuple[str, ...]]:
    table = _chosen(tables, part.file, what)
    try:
        raw = table.floats(part.columns)
    except DataError as error:
        raise DataError(f"{error}; the map names it in {what}.columns") from error
    if raw.shape[1] != 3:
        raise DataError(f"{table.path}: {what}: {part.columns[0]} has {raw.shape[1]} columns, expected three")
    column = part.time if part.time is not None else chart.time.column
    ns, notes = read_stamps(table, column, chart.time, len(raw))
    by_column = column is not None and chart.time.counter is None
    lone = lone_stamps(ns) if by_column else np.zeros(0, np.int64)
    if isinstance(table, TextTable) and len(lone):
        table.leave_out(lone.tolist(), "a time that does not lie between those before and after it")
        raw, ns = np.delete(raw, lone, axis=0), np.delete(ns, lone)
    if by_column and column is not None:
        notes = (*notes, *set_back(table, column, ns if isinstance(table, TextTable) else np.delete(ns, lone)))
    values = (raw - np.array(part.bias)) * part.factor
    if part.increments:
        values = values / _interval_s(table, ns)
    return ns, values, notes


def _interval_s(table: Table, ns: Stamps) -> float:
    """Usual interval (s), over which increments have come together."""
    interval = float(np.median(np.diff(ns))) if len(ns) > 1 else 0.0
    if interval <= 0.0:
        raise DataError(f"{table.path}: increments need the interval of the samples: state rate_hz in the map")
    return interval * 1e-9


def _temperature(tables: list[Table], chart: ImportMap, part: TemperatureMap) -> tuple[Stamps, Floats]:
    table = _chosen(tables, part.file, "temperature")
    raw = table.floats([part.column])[:, 0]
    ns, _ = read_stamps(table, part.time if part.time is not None else chart.time.column, chart.time, len(raw))
    value = (raw - part.bias) / part.counts_per_unit
    return ns, value - (_KELVIN if part.unit == "K" else 0.0)


def _status(tables: list[Table], chart: ImportMap, part: PhaseMap) -> Status:
    table = _chosen(tables, part.file, "phase")
    labels = table.texts(part.column)
    ns, _ = read_stamps(table, chart.time.column, chart.time, len(labels))
    return read_phase(table, part, ns)


def _joined(
    gyro_ns: Stamps, omega_ib_b: Floats, accel_ns: Stamps, f_ib_b: Floats
) -> tuple[Stamps, Floats, Floats, str]:
    """Bring accelerometers with stamps of their own to the stamps of the gyros, keeping their integral."""
    kept, force = mean_over(gyro_ns, accel_ns, f_ib_b)
    if not kept.any():
        raise DataError("import: accelerometer and gyro have no time in common; check their time columns and units")
    lost = int(np.count_nonzero(~kept))
    dropped = f"; {lost} gyro samples without accelerometer were dropped" if lost else ""
    note = f"accelerometer and gyro have stamps of their own: specific force was averaged over the gyro's{dropped}"
    return gyro_ns[kept], omega_ib_b[kept], force, note


Status = tuple[Stamps, Bools, Ints]
"""Stamp (ns), True for a rest, index of the stop; each entry holds from its stamp on."""
_SHOWN = 8
"""Number of different words that an error shows."""


def read_phase(table: Table, part: PhaseMap, ns: Stamps) -> Status:
    """Read the changes between rest and motion.

    Parameters
    ----------
    ns : ndarray of int64, shape (n,)
        Stamps of the rows (ns).

    Returns
    -------
    Status
        A rest begins with the interval of its first row: at the stamp of the row before.
    """
    labels = table.texts(part.column)
    if len(labels) != len(ns):
        raise DataError(f"{table.path}: column {part.column}: {len(labels)} labels for {len(ns)} samples")
    words = {label: is_rest(label, part.rest) for label in np.unique(labels).tolist()}
    if not any(words.values()):
        there = ", ".join(f"'{word}'" for word in list(words)[:_SHOWN])
        raise DataError(
            f"{table.path}: column {part.column} says rest nowhere (there are {there}): name its words for a rest in "
            "the map, phase.rest"
        )
    rest = np.array([words[label] for label in labels.tolist()])
    # From one label of a rest to another is another rest.
    change = np.append(True, (rest[1:] != rest[:-1]) | (rest[1:] & (labels[1:] != labels[:-1])))
    at = np.flatnonzero(change)
    stop = np.maximum(np.cumsum(rest[at]) - 1, 0)
    return ns[np.maximum(at - 1, 0)], rest[at], stop.astype(np.int64)
