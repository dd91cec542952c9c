"""Lines of a table as cells: between delimiters, in quotes or bare, with a decimal point or a decimal comma."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence

DELIMITERS = (";", "\t", ",")
_EDGES = " \t\"'"
_IN_QUOTES = re.compile(r'"[^"]*"')
_WITH_COMMA = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")
_WITH_POINT = re.compile(r"[-+]?\d*\.\d*(?:[eE][-+]?\d+)?")


def split(line: str, delimiter: str | None) -> list[str]:
    """Cut a line into cells; a delimiter in quotes is a part of its cell.

    `delimiter`: None stands for blanks and tabs.
    """
    if '"' not in line:
        return [cell.strip(_EDGES) for cell in line.split(delimiter)]
    bare = line if delimiter else line.replace("\t", " ").strip()
    try:
        cells = next(csv.reader([bare], delimiter=delimiter or " ", skipinitialspace=True), [])
    except csv.Error:
        # A cell of 100 kB and more, or a zero byte.
        cells = line.split(delimiter)
    return [cell.strip(_EDGES) for cell in cells]


def plain(line: str, delimiter: str | None, decimal: str) -> str:
    """Write a line of data without quotes and with decimal points, as numpy reads it."""
    if '"' not in line:
        return line if decimal == "." else line.replace(decimal, ".")
    between = delimiter or " "
    cells = (cell.replace(decimal, ".").replace(between, "_") for cell in split(line, delimiter))
    # Between blanks an empty cell would be none.
    return between.join(cell or ("" if delimiter else "-") for cell in cells)


def is_number(cell: str, decimal: str) -> bool:
    """Whether numpy reads a cell as a number."""
    if not cell.isascii() or "_" in cell:
        return False
    try:
        float(cell.replace(decimal, "."))
    except ValueError:
        return False
    return True


def delimiter_of(line: str, decimal: str) -> str | None:
    """Find what stands between the cells of a line; None stands for blanks and tabs."""
    if '"' in line:
        outside = _IN_QUOTES.sub("", line)
        return next((d for d in DELIMITERS if d in outside), None)
    return next((d for d in DELIMITERS if d in line and d != decimal), None)


def decimal_of(lines: Sequence[str], delimiter: str | None) -> str:
    """Tell the decimal comma from the point by how most numbers are written.

    `delimiter`: as the user states it; None tries all.
    """
    commas = points = 0
    for line in lines:
        cells = _apart_by_no_comma(line, delimiter)
        commas += sum(_WITH_COMMA.fullmatch(cell) is not None for cell in cells)
        points += sum(_WITH_POINT.fullmatch(cell) is not None for cell in cells)
    return "," if commas > points else "."


def _apart_by_no_comma(line: str, delimiter: str | None) -> list[str]:
    """Cut a line where a comma can be a decimal sign; no cells where it stands between them."""
    if delimiter or '"' in line:
        return split(line, delimiter or delimiter_of(line, "."))
    for one in (";", "\t"):
        if one in line:
            return split(line, one)
    cells = split(line, None)
    numbers = [cell for cell in cells if _WITH_COMMA.fullmatch(cell)]
    return cells if len(cells) > 1 and 2 * len(numbers) > len(cells) else []
