"""A table in a text file: CSV, columns between blanks or tabs, with headings or without.

Logs of NovAtel receivers in ASCII, long (``#RAWIMUA``) and short (``%RAWIMUSA``), are read as such a table. After the
header come week and seconds of GPS time, the status of the IMU, then increments in counts: accelerometers Z, -Y, X,
gyros Z, -Y, X. Source: OEM7 Commands and Logs Reference Manual, RAWIMU and RAWIMUS. The size of a count is that of the
IMU (table "Raw IMU Scale Factors" there).
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import yaml
from numpy.typing import NDArray

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.plain_text import counted
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.bounded_file import check_regular
from sdimu_calibration.storage.importing.cells import decimal_of, delimiter_of, is_number, plain, split
from sdimu_calibration.storage.importing.text_file import read_text

_COMMENT = ("#", "%")
_WHOLE, _REAL = 1, 2
_INTEGER = re.compile(r"[-+]?\d+")
_Item = TypeVar("_Item")
_SHOWN = 12
_LOOKED_AT = 200
"""Number of lines that say how many columns there are and how their numbers are written: a line more or less is no
matter."""
MOST_BROKEN = 0.005
"""Share of broken lines at most: a link that loses more loses numbers inside the lines, too."""
_MOST_COLUMNS = 1000
"""Number of columns at most: a file of more is no log of an IMU, and each column takes a pass over the file."""
_MOST_LEFT_OUT = 0.1
"""Share of lines that are left out without a word: comments of a logger are fewer."""
_LEAST_REAL = 3
"""Number of columns of real numbers that tell whole numbers above them from samples: a rest begins with two zeros."""
_MOST_HEADINGS = 10
"""Number of numeric heading lines at most: what is longer is a table of its own."""


def column_text(name: int | str) -> str:
    """Write the name of a column so that a map reads it back: headings may hold every character."""
    if isinstance(name, int):
        return str(name)
    return yaml.safe_dump(name, default_style='"', width=math.inf, allow_unicode=True).strip()


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
    decimal : str, optional
        ``.`` or ``,``; recognised when left out.
    skip_lines : int, optional
        Lines before the data; recognised when left out: blank, comment, mostly not numbers, of another number of
        columns than most, or real numbers where the data are integers (and the other way round).
    """

    def __init__(
        self, path: Path, delimiter: str | None = None, decimal: str | None = None, skip_lines: int | None = None
    ) -> None:
        self.path = path
        text, self.notes = read_text(path)
        self._lines = text.splitlines()
        self._delimiter = delimiter
        self._refuse_wide()
        logged = _is_novatel(self._lines)
        if logged:
            self._lines = _as_table(self._lines)
        self.decimal = decimal or decimal_of([line for line in _spread(self._lines) if not _skipped(line)], delimiter)
        if decimal is None and self.decimal == ",":
            self.notes = (*self.notes, f"{path}: its numbers are read with a decimal comma; decimal in the map says it")
        self._begin = self._first_line() if skip_lines is None else skip_lines
        if self._begin >= len(self._lines):
            raise DataError(f"{path}: no line of numbers in it")
        self._delimiter = delimiter or delimiter_of(self._lines[self._begin], self.decimal)
        if skip_lines is None:
            self._leave_out_numeric_headings()
        self.headings = list(_NOVATEL) if logged else self._find_headings()
        self._width = len(self._cells(self._lines[self._begin]))
        self._note_left_out()

    def name_of(self, column: int) -> int | str:
        """Name a column, from 0, as a map does: by its heading, or from 1 where that does not name it alone."""
        heading = self.headings[column] if column < len(self.headings) else ""
        return heading if heading and self.headings.count(heading) == 1 else column + 1

    @property
    def above(self) -> list[str]:
        """Lines above the data."""
        return self._lines[: self._begin]

    def leave_out_broken(self, as_nan: bool = False) -> bool:
        """Leave out lines that a serial link or a full disk broke, while they are few; whether there were any.

        `as_nan`: where the lines are the clock: they count as samples without numbers.
        """
        rows = self._rows()
        numeric = self._numeric(rows)
        broken = [k for k in rows if self._is_broken(self._cells(self._lines[k]), numeric)]
        if not broken or len(broken) > MOST_BROKEN * len(rows):
            return False
        instead = (self._delimiter or " ").join(["nan"] * self._width) if as_nan else ""
        what = "line is" if len(broken) == 1 else "lines are"
        self._replace(broken, instead, f"{len(broken)} of {len(rows)} {what} broken and left out")
        return True

    def leave_out(self, rows: Sequence[int], why: str) -> None:
        """Leave out rows of data, from 0; a note says why, and counts and numbers their lines."""
        lines = self._rows()
        self._replace([lines[row] for row in rows], "", f"{len(rows)} of {counted(len(lines), 'line')} left out: {why}")

    def _replace(self, lines: Sequence[int], instead: str, what: str) -> None:
        """Write something else in the place of lines, from 0."""
        for k in lines:
            self._lines[k] = instead
        shown = ", ".join(str(k + 1) for k in lines[:_SHOWN]) + (", ..." if len(lines) > _SHOWN else "")
        self.notes = (*self.notes, f"{self.path}: {what} (line {shown})")

    def _rows(self) -> list[int]:
        """Numbers of the lines of data, from 0."""
        return [k for k in range(self._begin, len(self._lines)) if not _skipped(self._lines[k])]

    def _numeric(self, rows: Sequence[int]) -> list[int]:
        """Columns, from 0, that hold numbers in most of some of the lines."""
        sample = [self._cells(self._lines[k]) for k in _spread(rows)]
        whole = [cells for cells in sample if len(cells) == self._width]
        return [
            c for c in range(self._width) if 2 * sum(is_number(cells[c], self.decimal) for cells in whole) > len(whole)
        ]

    def _is_broken(self, cells: Sequence[str], numeric: Sequence[int]) -> bool:
        if len(cells) != self._width:
            return True
        return not all(is_number(cells[c], self.decimal) for c in numeric)

    def floats(self, columns: Sequence[int | str]) -> Floats:
        """Read columns as numbers, shape (n, k); a cell ``nan`` is NaN."""
        places = [self.place(column) for column in columns]
        return np.asarray(self._load(columns, places, np.float64), np.float64)

    def numbers(self) -> Floats:
        """Read all columns as numbers, shape (n, k); a column that holds something else is NaN."""
        rows = self._rows()
        columns = [c + 1 for c in self._numeric(rows)]
        out = np.full((len(rows), self._width), np.nan)
        # One pass reads all columns; where one of them cannot be read, each takes its own.
        together = self._readable(columns)
        parts = [(columns, together)] if together is not None else [([c], self._readable([c])) for c in columns]
        for part, read in parts:
            if read is not None:
                out[:, [column - 1 for column in part]] = read
        return out

    def _readable(self, columns: Sequence[int]) -> Floats | None:
        try:
            return self.floats(columns)
        except DataError:
            return None

    def texts(self, column: int | str) -> NDArray[np.str_]:
        """Read a column as it is written, shape (n,)."""
        read = self._load([column], [self.place(column)], np.str_)[:, 0]
        return np.char.strip(np.asarray(read, np.str_), " \"'")

    def rows(self, column: int) -> int:
        """Count the rows of a column, from 0: all have as many."""
        del column
        return len(self._rows())

    def words(self, column: int) -> NDArray[np.str_]:
        """Read a column, from 0, as it is written, shape (n,)."""
        return self.texts(column + 1)

    def labels(self) -> dict[str, NDArray[np.str_]]:
        """Return columns of words that have no heading among those of the table: none."""
        return {}

    def _load(self, columns: Sequence[int | str], places: Sequence[int], kind: type[Any]) -> NDArray[Any]:
        """Read columns, shape (n, k)."""
        lines = self._data()
        try:
            read = np.loadtxt(lines, kind, _COMMENT, self._delimiter, usecols=places, ndmin=2)
        except (ValueError, IndexError) as error:
            raise self._first_bad(columns, places, kind is np.float64) from error
        if len(read) != len(lines):
            raise self._first_bad(columns, places, kind is np.float64)
        return read

    def others(self, named: Sequence[int | str]) -> list[str]:
        """List the columns beside some, by heading, else by number from 1; those that are not there count for none."""
        taken = {column - 1 if isinstance(column, int) else self._only(column) for column in named}
        names = [self.name_of(k) for k in range(self._width) if k not in taken]
        return [name if isinstance(name, str) else f"column {name}" for name in names]

    def _only(self, heading: str) -> int:
        """Place of the column of a heading, from 0; -1 where it is none, or not the only one."""
        return self.headings.index(heading) if self.headings.count(heading) == 1 else -1

    def line_of(self, row: int) -> str:
        """Say where a row of data is."""
        count = -1
        for number, line in enumerate(self._lines[self._begin :], start=self._begin + 1):
            count += not _skipped(line)
            if count == row:
                return f"line {number}"
        return f"row {row + 1}"

    def _data(self) -> list[str]:
        """Lines of data, as numpy reads them."""
        lines = [line for line in self._lines[self._begin :] if not _skipped(line)]
        # Most files need nothing; a call for each line would take longer than to read them.
        pointed = self.decimal == "."
        return [line if pointed and '"' not in line else plain(line, self._delimiter, self.decimal) for line in lines]

    def place(self, column: int | str) -> int:
        """Find the index of a column, from 0."""
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
            cells = self._cells(line, self._delimiter or delimiter_of(line, self.decimal))
            if len(cells) == width and _mostly_numbers(cells, self.decimal):
                return number
        return len(self._lines)

    def _refuse_wide(self) -> None:
        """Refuse a file of more columns than an IMU has, before they are looked at."""
        for number, line in _spread(list(enumerate(self._lines, start=1))):
            if len(line) <= _MOST_COLUMNS:
                continue
            between = self._delimiter or delimiter_of(line, "")
            columns = line.count(between) + 1 if between else len(line.split())
            if columns > _MOST_COLUMNS:
                raise DataError(
                    f"{self.path}: line {number} has {columns} columns, and {_MOST_COLUMNS} are the most: write each "
                    "sample on a line of its own, or state what stands between the columns (delimiter in the map)"
                )

    def _note_left_out(self) -> None:
        """Say that many lines are left out: comments between the data, or numbers above them."""
        above = [line for line in self._lines[: self._begin] if not _skipped(line)]
        numbers = [cells for line in above if _mostly_numbers(cells := self._cells(line), self.decimal)]
        skipped = [line for line in self._lines[self._begin :] if _skipped(line)]
        blank = sum(not line.strip() for line in skipped)
        left_out = len(numbers) + len(skipped) - blank
        lines = len(numbers) + len(self._lines) - self._begin - blank
        if left_out > _MOST_LEFT_OUT * lines:
            self.notes = (
                *self.notes,
                f"{self.path}: {left_out} of {lines} lines are left out: comments, or numbers above line "
                f"{self._begin + 1} in another number of columns",
            )

    def _usual_width(self) -> int:
        """Count the columns that most lines have."""
        lines = _spread([line for line in self._lines if not _skipped(line)])
        widths = Counter(len(self._cells(line, self._delimiter or delimiter_of(line, self.decimal))) for line in lines)
        return widths.most_common(1)[0][0] if widths else 0

    def _leave_out_numeric_headings(self) -> None:
        """Begin behind the first lines when their numbers are written otherwise than those of the data."""
        rows = self._rows()
        first, rest = rows[:_MOST_HEADINGS], rows[_MOST_HEADINGS:]
        if len(rest) < _LOOKED_AT:
            return
        forms = np.array([self._form(k) for k in _spread(rest)])
        whole, real = (forms == _WHOLE).all(axis=0), (forms == _REAL).all(axis=0)
        headings = [
            k
            for k in first
            if (np.array(self._form(k)) == _REAL)[whole].any()
            or (real.sum() >= _LEAST_REAL and not (np.array(self._form(k)) == _REAL)[real].any())
        ]
        if not headings:
            return
        self._begin = rows[rows.index(headings[-1]) + 1]
        self.notes = (
            *self.notes,
            f"{self.path}: lines up to {headings[-1] + 1} are headings in numbers, as they are written otherwise than "
            "the lines below them; skip_lines in the map says it if not",
        )

    def _form(self, number: int) -> list[int]:
        """How the numbers of a line are written."""
        width = len(self._cells(self._lines[self._begin]))
        cells = [*self._cells(self._lines[number]), *[""] * width][:width]
        real = [is_number(cell, self.decimal) and not _INTEGER.fullmatch(cell) for cell in cells]
        return [_REAL if is_real else _WHOLE if cell else 0 for is_real, cell in zip(real, cells, strict=True)]

    def _find_headings(self) -> list[str]:
        """Read the headings off the last line with words before the data; none when the numbers do not match.

        A heading that is a number names no column, as a number in the map counts the columns: it comes out empty.
        """
        width = len(self._cells(self._lines[self._begin]))
        for line in reversed(self._lines[: self._begin]):
            cells = self._cells(line.lstrip("#% "))
            words = ["" if is_number(cell, self.decimal) else cell for cell in cells]
            if len(words) == width and any(words):
                return words
        return []

    def _cells(self, line: str, delimiter: str | None = None) -> list[str]:
        return split(line, delimiter or self._delimiter)

    def _first_bad(self, columns: Sequence[int | str], places: Sequence[int], numbers: bool) -> DataError:
        """Find line and column of the first cell that cannot be read: slow, and only on the way out."""
        for number, line in enumerate(self._lines[self._begin :], start=self._begin + 1):
            if _skipped(line):
                continue
            cells = self._cells(line)
            for column, place in zip(columns, places, strict=True):
                if place >= len(cells):
                    return DataError(f"{self.path}: line {number} has {len(cells)} columns, no column {column}")
                if numbers and not is_number(cells[place], self.decimal):
                    return DataError(f"{self.path}: line {number}, column {column}: '{cells[place]}' is not a number")
        return DataError(f"{self.path}: cannot be read as a table (state delimiter and skip_lines in the map)")


def _spread(items: Sequence[_Item]) -> Sequence[_Item]:
    """Take some of many, from all over."""
    return items[:: max(len(items) // _LOOKED_AT, 1)]


def _mostly_numbers(cells: Sequence[str], decimal: str) -> bool:
    return 2 * sum(is_number(cell, decimal) for cell in cells) >= len(cells)


def _skipped(line: str) -> bool:
    return not line.strip() or line.lstrip().startswith(_COMMENT)


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
