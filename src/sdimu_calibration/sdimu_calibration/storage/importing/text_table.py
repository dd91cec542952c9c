"""A table in a text file: CSV, columns between blanks or tabs, with headings or without.

Logs of NovAtel receivers in ASCII, long (``#RAWIMUA``) and short (``%RAWIMUSA``), are read as such a table. After the
header come week and seconds of GPS time, the status of the IMU, then increments in counts: accelerometers Z, -Y, X,
gyros Z, -Y, X. Source: OEM7 Commands and Logs Reference Manual, RAWIMU and RAWIMUS. The size of a count is that of the
IMU (table "Raw IMU Scale Factors" there).
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.bounded_file import check_regular, read_text

_COMMENT = ("#", "%")
_DELIMITERS = (";", "\t", ",")
_WHOLE, _REAL = 1, 2
_INTEGER = re.compile(r"[-+]?\d+")
_Item = TypeVar("_Item")
_SHOWN = 12
_LOOKED_AT = 200
"""Number of lines that say how many columns there are and how their numbers are written: a line more or less is no
matter."""
_MOST_BROKEN = 0.005
"""Share of broken lines at most: a link that loses more loses numbers inside the lines, too."""
LONGEST_TABLE = 1 << 32
"""Bytes of a table of numbers at most: in memory its lines take three times as much. Several files are one import."""
_MOST_HEADINGS = 10
"""Number of numeric heading lines at most: what is longer is a table of its own."""


def check_file(path: Path) -> None:
    """Refuse what is no file to import."""
    if path.is_dir():
        raise DataError(f"{path}: is a folder: name the files in it (a folder that is a bag is read without an import)")
    check_regular(path)


class TextTable:
    """Columns of a text file, found by number (from 1) or by heading.

    Attributes
    ----------
    notes : tuple of str
        What was recognised and may be wrong.

    Parameters
    ----------
    delimiter : str, optional
        Recognised from the first line of data when left out.
    decimal : str
        ``.`` or ``,``.
    skip_lines : int, optional
        Lines before the data; recognised when left out: blank, comment, mostly not numbers, of another number of
        columns than most, or real numbers where the data are integers (and the other way round).
    """

    def __init__(
        self, path: Path, delimiter: str | None = None, decimal: str = ".", skip_lines: int | None = None
    ) -> None:
        self.path = path
        self._decimal = decimal
        try:
            self._lines = read_text(path, LONGEST_TABLE, "utf-8-sig").splitlines()
        except UnicodeDecodeError as error:
            raise DataError(
                f"{path}: is not text (expected CSV in UTF-8, MAT or NPZ); for bare numbers state their "
                "type and number in the map, such as binary: {type: float64, columns: 7}"
            ) from error
        self._delimiter = delimiter
        self.notes: tuple[str, ...] = ()
        logged = _is_novatel(self._lines)
        if logged:
            self._lines = _as_table(self._lines)
        self._begin = self._first_line() if skip_lines is None else skip_lines
        if self._begin >= len(self._lines):
            raise DataError(f"{path}: no line of numbers in it")
        self._delimiter = delimiter or self._guess(self._lines[self._begin])
        if skip_lines is None:
            self._leave_out_numeric_headings()
        self.headings = list(_NOVATEL) if logged else self._find_headings()
        self._width = len(self._cells(self._lines[self._begin]))

    @property
    def width(self) -> int:
        """Number of columns."""
        return self._width

    @property
    def above(self) -> list[str]:
        """Lines above the data."""
        return self._lines[: self._begin]

    def leave_out_broken(self, as_nan: bool = False) -> bool:
        """Leave out lines that a serial link or a full disk broke, while they are few; whether there were any.

        Parameters
        ----------
        as_nan : bool
            Where the lines are the clock: they count as samples without numbers.
        """
        rows = [k for k in range(self._begin, len(self._lines)) if not _skipped(self._lines[k])]
        sample = [self._cells(self._lines[k]) for k in _spread(rows)]
        whole = [cells for cells in sample if len(cells) == self._width]
        numeric = [
            c
            for c in range(self._width)
            if 2 * sum(_is_number(cells[c], self._decimal) for cells in whole) > len(whole)
        ]
        broken = [k for k in rows if self._is_broken(self._cells(self._lines[k]), numeric)]
        if not broken or len(broken) > _MOST_BROKEN * len(rows):
            return False
        instead = (self._delimiter or " ").join(["nan"] * self._width) if as_nan else ""
        for k in broken:
            self._lines[k] = instead
        shown = ", ".join(str(k + 1) for k in broken[:_SHOWN]) + (", ..." if len(broken) > _SHOWN else "")
        what = "line is" if len(broken) == 1 else "lines are"
        note = f"{self.path}: {len(broken)} of {len(rows)} {what} broken and left out (line {shown})"
        self.notes = (*self.notes, note)
        return True

    def _is_broken(self, cells: Sequence[str], numeric: Sequence[int]) -> bool:
        if len(cells) != self._width:
            return True
        return not all(_is_number(cells[c], self._decimal) for c in numeric)

    def floats(self, columns: Sequence[int | str]) -> Floats:
        """Read columns as numbers, shape (n, k); a cell ``nan`` is NaN."""
        places = [self._place(column) for column in columns]
        lines = self._data()
        if self._decimal == ",":
            lines = [line.replace(",", ".") for line in lines]
        try:
            read = np.loadtxt(lines, usecols=places, ndmin=2, **self._options())
        except (ValueError, IndexError) as error:
            raise self._first_bad(columns, places) from error
        return np.asarray(read, np.float64)

    def texts(self, column: int | str) -> NDArray[np.str_]:
        """Read a column as it is written, shape (n,)."""
        place = self._place(column)
        lines = self._data()
        try:
            read = np.loadtxt(lines, usecols=[place], ndmin=1, dtype=str, **self._options())
        except (ValueError, IndexError) as error:
            raise self._first_bad([column], [place], numbers=False) from error
        cells = np.char.strip(np.asarray(read, np.str_), " \"'")
        return np.char.replace(cells, ",", ".") if self._decimal == "," else cells

    def line_of(self, row: int) -> str:
        """Say where a row of data is."""
        count = -1
        for number, line in enumerate(self._lines[self._begin :], start=self._begin + 1):
            count += not _skipped(line)
            if count == row:
                return f"line {number}"
        return f"row {row + 1}"

    def _data(self) -> list[str]:
        """Lines of data."""
        return [line for line in self._lines[self._begin :] if not _skipped(line)]

    def _options(self) -> dict[str, Any]:
        return {"delimiter": self._delimiter, "comments": _COMMENT}

    def _place(self, column: int | str) -> int:
        """Index of a column."""
        if isinstance(column, int):
            if not 1 <= column <= self._width:
                raise DataError(f"{self.path}: no column {column} (line {self._begin + 1} has {self._width})")
            return column - 1
        number = self.headings.count(column)
        if number == 1:
            return self.headings.index(column)
        if number:
            raise DataError(f"{self.path}: {number} columns are called '{column}'; use the column's number")
        there = ", ".join(self.headings[:_SHOWN]) + (", ..." if len(self.headings) > _SHOWN else "")
        known = f"there are: {there}" if there else "the file has no headings; use the column's number"
        raise DataError(f"{self.path}: no column '{column}' ({known})")

    def _first_line(self) -> int:
        width = self._usual_width()
        for number, line in enumerate(self._lines):
            if _skipped(line):
                continue
            cells = self._cells(line, self._delimiter or self._guess(line))
            if len(cells) == width and 2 * sum(_is_number(cell, self._decimal) for cell in cells) >= len(cells):
                return number
        return len(self._lines)

    def _usual_width(self) -> int:
        """Count the columns that most lines have."""
        lines = _spread([line for line in self._lines if not _skipped(line)])
        widths = Counter(len(self._cells(line, self._delimiter or self._guess(line))) for line in lines)
        return widths.most_common(1)[0][0] if widths else 0

    def _leave_out_numeric_headings(self) -> None:
        """Begin behind the first lines when their numbers are written otherwise than those of the data."""
        rows = [k for k in range(self._begin, len(self._lines)) if not _skipped(self._lines[k])]
        first, rest = rows[:_MOST_HEADINGS], rows[_MOST_HEADINGS:]
        if len(rest) < _LOOKED_AT:
            return
        forms = np.array([self._form(k) for k in _spread(rest)])
        whole, real = (forms == _WHOLE).all(axis=0), (forms == _REAL).all(axis=0)
        headings = [
            k
            for k in first
            if (np.array(self._form(k)) == _REAL)[whole].any()
            or (real.all() and (np.array(self._form(k)) == _WHOLE).all())
        ]
        if not headings:
            return
        self._begin = rows[rows.index(headings[-1]) + 1]
        self.notes = (
            f"{self.path}: lines up to {headings[-1] + 1} are headings in numbers, as they are written otherwise than "
            "the lines below them; skip_lines in the map says it if not",
        )

    def _form(self, number: int) -> list[int]:
        """How the numbers of a line are written."""
        width = len(self._cells(self._lines[self._begin]))
        cells = [*self._cells(self._lines[number]), *[""] * width][:width]
        real = [_is_number(cell, self._decimal) and not _INTEGER.fullmatch(cell) for cell in cells]
        return [_REAL if is_real else _WHOLE if cell else 0 for is_real, cell in zip(real, cells, strict=True)]

    def _find_headings(self) -> list[str]:
        """Read the headings off the last line with words before the data; none when the numbers do not match."""
        width = len(self._cells(self._lines[self._begin]))
        for line in reversed(self._lines[: self._begin]):
            cells = self._cells(line.lstrip("#% "))
            if len(cells) == width:
                return cells
        return []

    def _guess(self, line: str) -> str | None:
        known = (d for d in _DELIMITERS if d in line and d != self._decimal)
        return next(known, None)

    def _cells(self, line: str, delimiter: str | None = None) -> list[str]:
        return [cell.strip(" \t\"'") for cell in line.split(delimiter or self._delimiter)]

    def _first_bad(self, columns: Sequence[int | str], places: Sequence[int], numbers: bool = True) -> DataError:
        """Find line and column of the first cell that cannot be read: slow, and only on the way out."""
        for number, line in enumerate(self._lines[self._begin :], start=self._begin + 1):
            if _skipped(line):
                continue
            cells = self._cells(line)
            for column, place in zip(columns, places, strict=True):
                if place >= len(cells):
                    return DataError(f"{self.path}: line {number} has {len(cells)} columns, no column {column}")
                if numbers and not _is_number(cells[place], self._decimal):
                    return DataError(f"{self.path}: line {number}, column {column}: '{cells[place]}' is not a number")
        return DataError(f"{self.path}: cannot be read as a table (state delimiter and skip_lines in the map)")


def _spread(items: list[_Item]) -> list[_Item]:
    """Take some of many, from all over."""
    return items[:: max(len(items) // _LOOKED_AT, 1)]


def _skipped(line: str) -> bool:
    return not line.strip() or line.lstrip().startswith(_COMMENT)


def _is_number(cell: str, decimal: str) -> bool:
    try:
        float(cell.replace(decimal, "."))
    except ValueError:
        return False
    return True


_NOVATEL = ("week", "seconds", "status", "accel_z", "-accel_y", "accel_x", "gyro_z", "-gyro_y", "gyro_x", "gps")
"""Names of the columns: those of the log, and `gps`, seconds of GPS time since its beginning on 1980-01-06."""
_NOVATEL_LOG = re.compile(r"[#%]RAWIMUS?A,[^;]*;(\d+),(\d+)(\.\d+)?,([0-9a-fA-F]+)((?:,-?\d+){6})\*[0-9a-fA-F]{8}\s*")
_WEEK_S = 604_800
"""Length of a GPS week (s): definition."""


def _is_novatel(lines: Sequence[str]) -> bool:
    """Whether some of the first lines are RAWIMU logs."""
    return any(_NOVATEL_LOG.fullmatch(line) for line in lines[:100])


def _as_table(lines: Sequence[str]) -> list[str]:
    """Return the logs as lines of numbers in the order of `_NOVATEL`; other lines come out empty: numbers stay."""
    return [_novatel_row(line) for line in lines]


def _novatel_row(line: str) -> str:
    match = _NOVATEL_LOG.fullmatch(line)
    if match is None:
        return ""
    week, second, fraction, status, counts = match.groups()
    gps = int(week) * _WEEK_S + int(second)
    return f"{week},{second}{fraction or ''},{int(status, 16)}{counts},{gps}{fraction or ''}"
