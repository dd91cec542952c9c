"""A table in a file of arrays: MATLAB's MAT, numpy's NPZ, or bare numbers as a map says."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.extras import lacking_module
from sdimu_calibration.storage.bags.own_process import run
from sdimu_calibration.storage.bags.unpacking import allowed
from sdimu_calibration.storage.importing.import_map import BinaryMap
from sdimu_calibration.storage.importing.mat_objects import HEAD, is_newest
from sdimu_calibration.storage.importing.mat_reader import CLOCK, OBJECT, PREFIX, UNIT
from sdimu_calibration.storage.importing.text_file import LONGEST_TABLE

_READER = Path(__file__).with_name("mat_reader.py")
_PATIENCE_S = 120.0
"""Time (s) that a MAT file may take: a gigabyte takes ten."""
_MATIO = "matio"
"""Module that reads objects of MATLAB, and its files of version 7.3."""
_OBJECTS = "Object arrays"
"""How numpy begins to say that an array holds objects of Python, which run code when they are read."""
_REFERENCE = re.compile(r"(.+?)(?:\[(\d+)\])?", re.DOTALL)


class Told(NamedTuple):
    """What a file of MATLAB says beside its numbers.

    Attributes
    ----------
    objects : mapping of str to str
        Class of each object that could not be read.
    units : mapping of str to str
        Units of arrays that are variables of a table.
    clocks : mapping of str to str
        Times of their rows, for arrays that are variables of a timetable.
    """

    objects: Mapping[str, str]
    units: Mapping[str, str]
    clocks: Mapping[str, str]


class ArrayTable:
    """Columns of a file of arrays: ``name``, ``struct.name``, or ``name[2]`` for the second column of a matrix."""

    def __init__(self, path: Path, arrays: Mapping[str, Any], told: Told | None = None) -> None:
        self.path = path
        self._arrays = {name: array for name, array in arrays.items() if not name.startswith("__")}
        self._told = told or Told({}, {}, {})

    def floats(self, columns: Sequence[int | str]) -> Floats:
        """Read columns as numbers, shape (n, k); one matrix may hold all of them, either way round."""
        arrays = [self._array(column) for column in columns]
        parts = [array.astype(np.float64) for array in arrays]
        for column, array, part in zip(columns, arrays, parts, strict=True):
            if array.dtype.kind == "M":
                raise DataError(f"{self.path}: variable {column} holds dates, expected numbers")
            if len(part) != len(parts[0]):
                raise DataError(
                    f"{self.path}: variable {column} has {len(part)} rows, {columns[0]} has {len(parts[0])}"
                )
        return np.concatenate(parts, axis=1)

    def matrices(self) -> dict[str, NDArray[Any]]:
        """Return the variables that may be columns of an IMU, each shape (n, k), by name."""
        names = [name for name, value in self._arrays.items() if _is_matrix(np.asarray(value))]
        return {name: self._array(name) for name in names}

    def unit_of(self, name: str) -> str:
        """Return the unit that a table of MATLAB states for a variable; empty where it states none."""
        return self._told.units.get(name, "")

    def clock_of(self, name: str) -> str:
        """Return the variable with the times of a variable of a timetable; empty where it is none."""
        return self._told.clocks.get(name, "")

    def place(self, column: int | str) -> int | str:
        """Return what tells a column from others."""
        return str(column)

    def texts(self, column: int | str) -> NDArray[np.str_]:
        """Read one column as words, shape (n,): text as it is written, truths as true and false, numbers as short."""
        name = str(column)
        value = np.asarray(self._arrays.get(name, ()))
        return as_words(value) if is_label(value) else as_words(self.numbers(column))

    def labels(self) -> dict[str, NDArray[np.str_]]:
        """Return the variables of words or truths, which may say what is a rest, each shape (n,), by name."""
        return {name: as_words(np.asarray(value)) for name, value in self._arrays.items() if is_label(value)}

    def others(self, named: Sequence[int | str]) -> list[str]:
        """List what is there beside some columns, with sizes: whole variables, or single columns of them."""
        whole = {str(column) for column in named}
        some: dict[str, set[int]] = {}
        for name in whole - self._arrays.keys():
            match = _REFERENCE.fullmatch(name)
            if match and match.group(2):
                some.setdefault(match.group(1), set()).add(int(match.group(2)))
        out = []
        for name, array in self._arrays.items():
            if name in some and name not in whole:
                out += [f"{name}[{k}]" for k in range(1, self._array(name).shape[1] + 1) if k not in some[name]]
            elif name not in whole:
                out.append(_sized(name, array))
        return out

    def contents(self) -> str:
        """List the variables with their sizes."""
        self._refuse_object("")
        return ", ".join(_sized(name, array) for name, array in sorted(self._arrays.items())) or "(none)"

    def numbers(self, column: int | str) -> NDArray[Any]:
        """Read one column in the type it has, shape (n,), so that integer stamps and dates stay exact."""
        array = self._array(column)
        if array.shape[1] != 1:
            raise DataError(f"{self.path}: variable {column} has {array.shape[1]} columns, expected one")
        return array[:, 0]

    def line_of(self, row: int) -> str:
        """Say where a row of data is."""
        return f"row {row + 1}"

    def _array(self, column: int | str) -> NDArray[Any]:
        """Return a variable, or one column of it, as a matrix with samples in its rows."""
        # In a table of MATLAB any text is a name, brackets too.
        whole = str(column) in self._arrays
        match = None if whole else _REFERENCE.fullmatch(str(column))
        name = match.group(1) if match else str(column)
        value: Any = self._arrays.get(name)
        if value is None:
            self._refuse_object(str(column))
            there = ", ".join(sorted(self._arrays)) or "none"
            raise DataError(f"{self.path}: no variable '{column}' (there are: {there})")
        array = np.asarray(value)
        if not _is_matrix(array):
            self._refuse_object(str(column))
            if array.dtype.kind == "O":
                raise DataError(
                    f"{self.path}: variable {name} holds objects of Python, which are not read: save it as numbers or "
                    f"words, {name}.astype(float) or {name}.astype(str)"
                )
            raise DataError(f"{self.path}: variable {column} is not a list or matrix of numbers")
        array = array[:, None] if array.ndim == 1 else array
        array = array.T if array.shape[0] < array.shape[1] else array
        if match is None or match.group(2) is None:
            return array
        place = int(match.group(2))
        if not 1 <= place <= array.shape[1]:
            raise DataError(f"{self.path}: variable {name} has {array.shape[1]} columns, no column {place}")
        return array[:, place - 1 : place]

    def _refuse_object(self, column: str) -> None:
        """Say how numbers get out of an object of MATLAB: scipy reads its name and its class alone."""
        objects = self._told.objects
        for name, kind in objects.items():
            if column.split(".", maxsplit=1)[0] == name or len(objects) == len(self._arrays):
                here = "" if find_spec(_MATIO) else f"{lacking_module(_MATIO)}; or "
                raise DataError(
                    f"{self.path}: variable {name} is a MATLAB {kind}, which cannot be read: {here}in MATLAB: t = "
                    f"{name}.Properties.RowTimes; s = struct('t', seconds(t - t(1)), 'data', {name}.Variables); "
                    f"save('{name}_numbers.mat', '-struct', 's', '-v7'); the columns are then t, data[1], data[2], ..."
                )


def _sized(name: str, array: Any) -> str:
    """Write a variable with its size; a single number has none, and what cannot be read none either."""
    size = " x ".join(map(str, np.shape(array))) if np.size(array) else ""
    return f"{name} ({size})" if size else name


def is_label(value: Any) -> bool:
    """Whether a variable is a list of words or of truths, one a sample."""
    array = np.asarray(value)
    return array.dtype.kind in "USb" and max(array.shape, default=0) == array.size > 1


def as_words(value: NDArray[Any]) -> NDArray[np.str_]:
    """Write words, truths or numbers as words, shape (n,)."""
    flat = value.ravel()
    if flat.dtype.kind == "b":
        return np.where(flat, "true", "false")
    if flat.dtype.kind == "S":
        return np.char.strip(np.char.decode(flat, "utf-8", "replace"))
    if flat.dtype.kind == "U":
        return np.char.strip(flat)
    return np.array([f"{one:g}" for one in flat.tolist()])


def _is_matrix(array: NDArray[Any]) -> bool:
    """Whether an array is a list or matrix of numbers or dates."""
    return array.dtype.kind in "iufM" and array.ndim in {1, 2} and array.size > 0


def read_npz(path: Path) -> ArrayTable:
    """Read a file of numpy."""
    try:
        with zipfile.ZipFile(path) as packed:
            size = sum(entry.file_size for entry in packed.infolist())
        if size > _most(path):
            raise DataError(f"{path}: unpacks to {size} bytes, more than {_most(path)}")
        with np.load(path, allow_pickle=False) as content:
            return ArrayTable(path, {name: _shaped(content, name) for name in content.files})
    except (DataError, PermissionError):
        raise
    except Exception as error:
        # numpy answers damage with errors of zipfile, zlib, struct, ast, tokenize, and of the memory.
        raise DataError(f"{path}: not a file of numpy arrays (NPZ) that can be read") from error


def _most(path: Path) -> int:
    """Bytes that a file may unpack to; on their way to samples they are there up to four times."""
    return allowed(path) // 4


def _shaped(content: Any, name: str) -> NDArray[Any]:
    """Return an array of a file; bytes that are none of numpy, and objects of Python, are no variable."""
    try:
        array = content[name]
    except ValueError as error:
        if _OBJECTS not in str(error):
            raise
        return np.empty(0, np.object_)
    return np.asarray(array) if isinstance(array, np.ndarray) else np.empty(0)


def read_mat(path: Path) -> ArrayTable | None:
    """Read a MAT file; None when it is a matrix written as text.

    The readers trust what the file says of itself; they work in a process of their own, which may end as it likes and
    gets the memory that the file may unpack to.
    """
    with path.open("rb") as stream:
        head = stream.read(HEAD)
    if not head:
        raise DataError(f"{path}: the file is empty")
    if is_newest(head) and not find_spec(_MATIO):
        raise DataError(
            f"{path}: is a MAT file of version 7.3: {lacking_module(_MATIO)}; or save it in MATLAB with '-v7'"
        )
    if not is_newest(head) and _is_text(head):
        return None
    with TemporaryDirectory(prefix="sdimu-") as folder:
        plain = Path(folder) / "plain.npz"
        run(_READER, path, plain, _most(path), _PATIENCE_S, "not a MAT file that can be read")
        with np.load(plain, allow_pickle=False) as content:
            entries = {name: content[name] for name in content.files}
    arrays = {name.removeprefix(PREFIX): array for name, array in entries.items() if name.startswith(PREFIX)}
    objects, units, clocks = (
        {name.removeprefix(mark): str(word) for name, word in entries.items() if name.startswith(mark)}
        for mark in (OBJECT, UNIT, CLOCK)
    )
    return ArrayTable(path, arrays, Told(objects, units, clocks))


def _is_text(head: bytes) -> bool:
    """Tell numbers in text: a MAT file of version 5 begins with words, one of version 4 with binary zeros."""
    return not head.startswith(b"MATLAB") and b"\x00" not in head


class BinaryTable(ArrayTable):
    """Columns of a file of bare numbers, by number from 1."""

    def __init__(self, path: Path, form: BinaryMap) -> None:
        kind = np.dtype(form.type).newbyteorder(">" if form.big_endian else "<")
        size, row = path.stat().st_size - form.skip_bytes, form.columns * kind.itemsize
        if size < row or size % row:
            raise DataError(
                f"{path}: {max(size, 0)} bytes are no whole rows of {form.columns} {form.type} ({row} bytes each); "
                "check binary.type, columns and skip_bytes in the map"
            )
        if size > LONGEST_TABLE:
            raise DataError(f"{path}: {size} bytes, more than {LONGEST_TABLE}; cut it into several files")
        numbers = np.fromfile(path, kind, offset=form.skip_bytes).reshape(-1, form.columns)
        super().__init__(path, {})
        self._numbers: NDArray[Any] = numbers.astype(kind.newbyteorder("="))

    def _array(self, column: int | str) -> NDArray[Any]:
        width = self._numbers.shape[1]
        if not isinstance(column, int) or not 1 <= column <= width:
            raise DataError(f"{self.path}: no column {column} (a binary file has columns 1 to {width})")
        return self._numbers[:, column - 1 : column]

    def texts(self, column: int | str) -> NDArray[np.str_]:
        """Read one column as words, shape (n,): numbers, written short."""
        return as_words(self._array(column)[:, 0])

    def others(self, named: Sequence[int | str]) -> list[str]:
        """List the columns beside some, by number from 1."""
        return [f"column {k}" for k in range(1, self._numbers.shape[1] + 1) if k not in named]
