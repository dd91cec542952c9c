"""Columns of a file of arrays as a proposal of a map looks at them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.storage.importing.array_table import ArrayTable, as_words
from sdimu_calibration.storage.importing.columns import sensors_by_heading

_ALIKE = 0.05
"""Share by which lengths of columns may differ that are looked at side by side: two sensors of one rate, which were not
started at once."""
_MOST_COLUMNS = 1000
"""Number of columns at most, as of text."""
_LEAST_ROWS = 10
"""Number of rows below which a variable is no log of a sensor."""


class _Column(NamedTuple):
    """One column: its variable, which has `width` columns, its place there from 1, and its numbers, shape (n,)."""

    variable: str
    place: int
    width: int
    values: NDArray[Any]


class ArrayColumns:
    """The columns of a file of arrays that are of about one length, as a table with headings.

    A variable of three columns is read as x, y and z. Dates are clocks and no columns of numbers.

    Attributes
    ----------
    headings : list of str
        Names without what all of them begin with, with axes and units.
    """

    notes: tuple[str, ...] = ()
    decimal = "."
    above: Sequence[str] = ()

    def __init__(self, table: ArrayTable, columns: Sequence[_Column]) -> None:
        self.path = table.path
        self._table = table
        self._columns = list(columns)
        shared = _shared([one.variable for one in columns])
        self.headings = [self._heading(one, len(shared)) for one in columns]

    @property
    def contents(self) -> str:
        """The variables of the file with their sizes."""
        return self._table.contents()

    def numbers(self) -> Floats:
        """Numbers of all columns, shape (n, k), as long as the shortest."""
        rows = min(len(one.values) for one in self._columns)
        return np.column_stack([one.values[:rows].astype(np.float64) for one in self._columns])

    def name_of(self, column: int) -> str:
        """Name a column, from 0, as a map does."""
        one = self._columns[column]
        return f"{one.variable}[{one.place}]" if one.width > 1 else one.variable

    def texts(self, column: int | str) -> NDArray[Any]:
        """Return nothing that could be a date: those are no columns here."""
        return np.full(len(self._columns[int(column) - 1].values), "")

    def rows(self, column: int) -> int:
        """Count the rows of a column, from 0."""
        return len(self._columns[column].values)

    def words(self, column: int) -> NDArray[np.str_]:
        """Write the numbers of a column, from 0, as words, shape (n,)."""
        return as_words(self._columns[column].values)

    def labels(self) -> dict[str, NDArray[np.str_]]:
        """Return the variables of words or truths, each shape (n,), by name."""
        return self._table.labels()

    def others(self, named: Sequence[int | str]) -> list[str]:
        """List what is in the file beside some columns, with sizes."""
        return self._table.others(named)

    def clock_of(self, column: int) -> str:
        """Name the times of the timetable in which a column, from 0, stands; empty where it stands in none."""
        return self._table.clock_of(self._columns[column].variable)

    def clock(self, name: str) -> tuple[float, bool]:
        """Return the usual rate of a variable of times (Hz; 0 where they do not ascend), and whether they are dates."""
        times = self._table.numbers(name)
        dates = times.dtype.kind == "M"
        seconds = (times - times[0]).astype(np.float64) * 1e-9 if dates else times.astype(np.float64)
        step = float(np.nanmedian(np.diff(seconds))) if len(seconds) > 1 else 0.0
        return (1.0 / step if step > 0.0 else 0.0), dates

    def _heading(self, one: _Column, cut: int) -> str:
        name = one.variable[cut:].replace(".", " ")
        if one.width > 1:
            name += f" {'xyz'[one.place - 1] if one.width == 3 else one.place}"
        unit = self._table.unit_of(one.variable)
        return f"{name} [{unit}]" if unit else name


def array_columns(table: ArrayTable) -> ArrayColumns | None:
    """Choose the columns in which an IMU is to be looked for: of one length, those with names of sensors first.

    Returns
    -------
    ArrayColumns or None
        None where no variable is as long as a log of a sensor.
    """
    columns = [
        _Column(name, k + 1, matrix.shape[1], matrix[:, k])
        for name, matrix in table.matrices().items()
        if len(matrix) >= _LEAST_ROWS and matrix.dtype.kind != "M" and matrix.shape[1] <= _MOST_COLUMNS
        for k in range(matrix.shape[1])
    ]
    clocks = {table.clock_of(one.variable) for one in columns}
    columns = [one for one in columns if one.variable not in clocks][:_MOST_COLUMNS]
    if not columns:
        return None
    lengths = sorted({len(one.values) for one in columns}, reverse=True)
    views = [
        ArrayColumns(table, [one for one in columns if (1.0 - _ALIKE) * rows <= len(one.values) <= rows])
        for rows in lengths
    ]
    return next((view for view in views if all(sensors_by_heading(view.headings))), views[0])


def _shared(names: Sequence[str]) -> str:
    """Return the structures or tables in which all variables stand, with the dot."""
    parts = [name.split(".")[:-1] for name in names]
    same = next((k for k in range(min(map(len, parts))) if len({part[k] for part in parts}) > 1), min(map(len, parts)))
    return "".join(f"{part}." for part in parts[0][:same])
