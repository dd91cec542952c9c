"""Files from elsewhere (CSV, MAT, NPZ) to the samples of an IMU, as a map says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.data.resample import mean_over, same_stamps
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.array_table import read_mat, read_npz
from sdimu_calibration.storage.bag_writer import write_recording
from sdimu_calibration.storage.import_map import ImportMap, SensorMap, TemperatureMap
from sdimu_calibration.storage.import_stamps import Stamps, Table, read_stamps
from sdimu_calibration.storage.text_table import TextTable

_KELVIN = 273.15


@dataclass(frozen=True)
class Imported:
    """Samples as a bag holds them.

    Attributes
    ----------
    ns : ndarray of int64, shape (n,)
        Stamps (ns since 1970), as the file has them: gaps, jitter and repetitions stay.
    omega_ib_b, f_ib_b : ndarray, shape (n, 3)
        rad/s, m/s^2; NaN where the file says so.
    temperature : (ndarray (m,), ndarray (m,)) or None
        Stamps (ns), deg C.
    notes : tuple of str
        What was done beyond copying.
    """

    ns: Stamps
    omega_ib_b: Floats
    f_ib_b: Floats
    temperature: tuple[Stamps, Floats] | None
    notes: tuple[str, ...]


def read_files(paths: Sequence[Path], chart: ImportMap) -> Imported:
    """Read the files that a map describes.

    Parameters
    ----------
    paths : sequence of Path
        CSV (or any columns in text), MAT up to version 7, NPZ.
    chart : ImportMap

    Returns
    -------
    Imported

    Raises
    ------
    DataError
        One line with file, line and column of what cannot be used.
    """
    tables = [_open(Path(path), chart) for path in paths]
    accel_ns, f_ib_b = _sensor(tables, chart, chart.accel, "accel")
    gyro_ns, omega_ib_b = _sensor(tables, chart, chart.gyro, "gyro")
    notes: tuple[str, ...] = ()
    if not same_stamps(gyro_ns, accel_ns):
        gyro_ns, omega_ib_b, f_ib_b, notes = _joined(gyro_ns, omega_ib_b, accel_ns, f_ib_b)
    temperature = None if chart.temperature is None else _temperature(tables, chart, chart.temperature)
    return Imported(gyro_ns, omega_ib_b, f_ib_b, temperature, notes)


def write_imported(path: Path, found: Imported, replace: bool = False) -> None:
    """Write imported samples to a rosbag2 folder.

    Raises
    ------
    DataError
        When something is in the way of the folder.
    """
    write_recording(
        path,
        start_ns=0,
        imu_ns=found.ns,
        omega_ib_b=found.omega_ib_b,
        f_ib_b=found.f_ib_b,
        temperature=found.temperature,
        replace=replace,
    )


def _open(path: Path, chart: ImportMap) -> Table:
    if not path.is_file():
        raise DataError(f"{path}: no such file")
    kind = path.suffix.lower()
    if kind == ".npz":
        return read_npz(path)
    arrays = read_mat(path) if kind == ".mat" else None
    return arrays or TextTable(path, chart.delimiter, chart.decimal, chart.skip_lines)


def _chosen(tables: list[Table], pattern: str | None, what: str) -> Table:
    """Find the file that holds something.

    Raises
    ------
    DataError
        When it is none or not clear which.
    """
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


def _sensor(tables: list[Table], chart: ImportMap, part: SensorMap, what: str) -> tuple[Stamps, Floats]:
    table = _chosen(tables, part.file, what)
    raw = table.floats(part.columns)
    if raw.shape[1] != 3:
        raise DataError(f"{table.path}: {what}: {part.columns[0]} has {raw.shape[1]} columns, expected three")
    ns = read_stamps(table, part.time if part.time is not None else chart.time.column, chart.time, len(raw))
    return ns, (raw - np.array(part.bias)) * part.factor


def _temperature(tables: list[Table], chart: ImportMap, part: TemperatureMap) -> tuple[Stamps, Floats]:
    table = _chosen(tables, part.file, "temperature")
    raw = table.floats([part.column])[:, 0]
    ns = read_stamps(table, part.time if part.time is not None else chart.time.column, chart.time, len(raw))
    value = (raw - part.bias) / part.counts_per_unit
    return ns, value - (_KELVIN if part.unit == "K" else 0.0)


def _joined(
    gyro_ns: Stamps, omega_ib_b: Floats, accel_ns: Stamps, f_ib_b: Floats
) -> tuple[Stamps, Floats, Floats, tuple[str, ...]]:
    """Bring accelerometers with stamps of their own to the stamps of the gyros, keeping their integral."""
    kept, force = mean_over(gyro_ns, accel_ns, f_ib_b)
    if not kept.any():
        raise DataError("import: accelerometer and gyro have no time in common; check their time columns and units")
    lost = int(np.count_nonzero(~kept))
    dropped = f"; {lost} gyro samples without accelerometer were dropped" if lost else ""
    note = f"accelerometer and gyro have stamps of their own: specific force was averaged over the gyro's{dropped}"
    return gyro_ns[kept], omega_ib_b[kept], force, (note,)
