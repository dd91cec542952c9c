"""A table in a file of bare numbers: rows of doubles, floats or integers, as a map says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.importing.array_table import ArrayTable
from sdimu_calibration.storage.importing.import_map import BinaryMap


class BinaryTable(ArrayTable):
    """Columns of a file of bare numbers, by number from 1.

    Parameters
    ----------
    path : Path
    form : BinaryMap

    Raises
    ------
    DataError
        When the file does not hold whole rows.
    """

    def __init__(self, path: Path, form: BinaryMap) -> None:
        kind = np.dtype(form.type).newbyteorder(">" if form.big_endian else "<")
        size, row = path.stat().st_size - form.skip_bytes, form.columns * kind.itemsize
        if size < row or size % row:
            raise DataError(
                f"{path}: {max(size, 0)} bytes are no whole rows of {form.columns} {form.type} ({row} bytes each); "
                "check binary.type, columns and skip_bytes in the map"
            )
        numbers = np.fromfile(path, kind, offset=form.skip_bytes).reshape(-1, form.columns)
        super().__init__(path, {})
        self._numbers: NDArray[Any] = numbers.astype(kind.newbyteorder("="))

    def _array(self, column: int | str) -> NDArray[Any]:
        width = self._numbers.shape[1]
        if not isinstance(column, int) or not 1 <= column <= width:
            raise DataError(f"{self.path}: no column {column} (a binary file has columns 1 to {width})")
        return self._numbers[:, column - 1 : column]
