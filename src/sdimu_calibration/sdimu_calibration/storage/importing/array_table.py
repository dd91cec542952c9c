"""A table in a file of arrays: MATLAB's MAT up to version 7, numpy's NPZ, or bare numbers as a map says."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags.own_process import run
from sdimu_calibration.storage.bags.unpacking import allowed
from sdimu_calibration.storage.importing.import_map import BinaryMap
from sdimu_calibration.storage.importing.mat_reader import OBJECT, PREFIX
from sdimu_calibration.storage.importing.text_file import LONGEST_TABLE

_HDF5 = b"\x89HDF\r\n\x1a\n"
_HDF5_AT = 512
_VERSION_7_3 = b"MATLAB 7.3"
_READER = Path(__file__).with_name("mat_reader.py")
_PATIENCE_S = 120.0
"""Time (s) that a MAT file may take: a gigabyte takes ten."""
_REFERENCE = re.compile(r"([A-Za-z_]\w*(?:\.\w+)*)(?:\[(\d+)\])?")


class ArrayTable:
    """Columns of a file of arrays: ``name``, ``struct.name``, or ``name[2]`` for the second column of a matrix."""

    def __init__(self, path: Path, arrays: Mapping[str, Any], objects: Mapping[str, str] | None = None) -> None:
        self.path = path
        self._arrays = {name: array for name, array in arrays.items() if not name.startswith("__")}
        self._objects = dict(objects or {})

    def floats(self, columns: Sequence[int | str]) -> Floats:
        """Read columns as numbers, shape (n, k); one matrix may hold all of them, either way round."""
        parts = [self._array(column).astype(np.float64) for column in columns]
        for column, part in zip(columns, parts, strict=True):
            if len(part) != len(parts[0]):
                raise DataError(
                    f"{self.path}: variable {column} has {len(part)} rows, {columns[0]} has {len(parts[0])}"
                )
        return np.concatenate(parts, axis=1)

    def place(self, column: int | str) -> int | str:
        """Return what tells a column from others."""
        return str(column)

    def contents(self) -> str:
        """List the variables with their sizes."""
        self._refuse_object("")
        sizes = {name: " x ".join(map(str, np.shape(array))) for name, array in sorted(self._arrays.items())}
        return ", ".join(f"{name} ({size})" if size else name for name, size in sizes.items()) or "(none)"

    def numbers(self, column: int | str) -> NDArray[Any]:
        """Read one column in the type it has, shape (n,), so that integer stamps stay exact."""
        array = self._array(column)
        if array.shape[1] != 1:
            raise DataError(f"{self.path}: variable {column} has {array.shape[1]} columns, expected one")
        return array[:, 0]

    def line_of(self, row: int) -> str:
        """Say where a row of data is."""
        return f"row {row + 1}"

    def _array(self, column: int | str) -> NDArray[Any]:
        """Return a variable, or one column of it, as a matrix with samples in its rows."""
        match = _REFERENCE.fullmatch(str(column))
        value: Any = self._arrays.get(match.group(1)) if match else None
        if match is None or value is None:
            self._refuse_object(str(column))
            there = ", ".join(sorted(self._arrays)) or "none"
            raise DataError(f"{self.path}: no variable '{column}' (there are: {there})")
        array = np.asarray(value)
        if array.dtype.kind not in "iuf" or array.ndim not in {1, 2} or not array.size:
            raise DataError(f"{self.path}: variable {column} is not a list or matrix of numbers")
        array = array[:, None] if array.ndim == 1 else array
        array = array.T if array.shape[0] < array.shape[1] else array
        if match.group(2) is None:
            return array
        place = int(match.group(2))
        if not 1 <= place <= array.shape[1]:
            raise DataError(f"{self.path}: variable {match.group(1)} has {array.shape[1]} columns, no column {place}")
        return array[:, place - 1 : place]

    def _refuse_object(self, column: str) -> None:
        """Say how numbers get out of an object of MATLAB: scipy reads its name and its class alone."""
        for name, kind in self._objects.items():
            if column.split(".", maxsplit=1)[0] == name or len(self._objects) == len(self._arrays):
                raise DataError(
                    f"{self.path}: variable {name} is a MATLAB {kind}, which MATLAB alone can read; there: t = "
                    f"{name}.Properties.RowTimes; s = struct('t', seconds(t - t(1)), 'data', {name}.Variables); "
                    f"save('{name}_numbers.mat', '-struct', 's', '-v7'); the columns are then t, data[1], data[2], ..."
                )


def read_npz(path: Path) -> ArrayTable:
    """Read a file of numpy."""
    try:
        with zipfile.ZipFile(path) as packed:
            size = sum(entry.file_size for entry in packed.infolist())
        if size > _most(path):
            raise DataError(f"{path}: unpacks to {size} bytes, more than {_most(path)}")
        with np.load(path, allow_pickle=False) as content:
            return ArrayTable(path, {name: _shaped(content[name]) for name in content.files})
    except (DataError, PermissionError):
        raise
    except Exception as error:
        # numpy answers damage with errors of zipfile, zlib, struct, ast, tokenize, and of the memory.
        raise DataError(f"{path}: not a file of numpy arrays (NPZ) that can be read") from error


def _most(path: Path) -> int:
    """Bytes that a file may unpack to; on their way to samples they are there up to four times."""
    return allowed(path) // 4


def _shaped(array: Any) -> NDArray[Any]:
    """Return an array of numbers; bytes of a file that is none of numpy are no variable."""
    return np.asarray(array) if isinstance(array, np.ndarray) else np.empty(0)


def read_mat(path: Path) -> ArrayTable | None:
    """Read a MAT file of version 4 to 7; None when it is a matrix written as text.

    The reader of scipy trusts what the file says of itself; it works in a process of its own, which may end as it
    likes and gets the memory that the file may unpack to.
    """
    with path.open("rb") as stream:
        head = stream.read(_HDF5_AT + len(_HDF5))
    if not head:
        raise DataError(f"{path}: the file is empty")
    if head[_HDF5_AT:] == _HDF5 or head.startswith((_HDF5, _VERSION_7_3)):
        raise DataError(f"{path}: is a MAT file of version 7.3; save it in MATLAB with '-v7'")
    if _is_text(head):
        return None
    with TemporaryDirectory(prefix="sdimu-") as folder:
        plain = Path(folder) / "plain.npz"
        run(_READER, path, plain, _most(path), _PATIENCE_S, "not a MAT file that can be read")
        with np.load(plain, allow_pickle=False) as content:
            arrays = {name.removeprefix(PREFIX): content[name] for name in content.files}
    objects = {name.removeprefix(OBJECT): str(arrays.pop(name)) for name in list(arrays) if name.startswith(OBJECT)}
    return ArrayTable(path, arrays, objects)


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
