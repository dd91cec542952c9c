"""Times of a file from elsewhere as stamps: exact to the nanosecond where the file is."""

from __future__ import annotations

from datetime import datetime, timezone
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import parse_unit
from sdimu_calibration.storage.array_table import ArrayTable
from sdimu_calibration.storage.import_map import ISO, NANOSECONDS, TimeMap
from sdimu_calibration.storage.text_table import TextTable

Stamps = Ints
Table = TextTable | ArrayTable

_DIGITS = {"s": 9, "ms": 6, "us": 3, "ns": 0}
"""Decimal places of a nanosecond in each unit."""
_LONGEST = 19
"""Digits of a number of nanoseconds in 64 bits."""
_LARGEST_NS = 4e18
"""Times beyond this (the year 2096) do not fit a stamp."""


def read_stamps(table: Table, column: int | str | None, time: TimeMap, samples: int) -> Stamps:
    """Read the stamps of a table.

    Parameters
    ----------
    table : TextTable or ArrayTable
    column : int or str or None
        None makes them from the rate.
    time : TimeMap
    samples : int
        How many there must be.

    Returns
    -------
    ndarray of int64, shape (n,)
        ns since 1970.

    Raises
    ------
    DataError
        With line and column of the first time that is none, or lies before 1970.
    """
    if column is None:
        assert time.rate_hz is not None
        ns = np.rint(np.arange(1, samples + 1) * (1e9 / time.rate_hz)).astype(np.int64)
    elif isinstance(table, TextTable):
        ns = _from_text(table, column, time.unit)
    else:
        ns = _from_numbers(table, column, time.unit)
    if len(ns) != samples:
        raise DataError(f"{table.path}: {len(ns)} times for {samples} samples")
    ns = ns + _start_ns(time.start)
    if (ns < 0).any():
        row = int(np.argmax(ns < 0))
        raise DataError(f"{table.path}: {table.line_of(row)}, column {column}: a time before 1970; check time.start")
    return np.asarray(ns, np.int64)


def _start_ns(start: datetime | None) -> int:
    if start is None:
        return 0
    if start.tzinfo is None:
        start = start.replace(tzinfo=timezone.utc)
    elapsed = start - datetime(1970, 1, 1, tzinfo=timezone.utc)
    return (elapsed.days * 86_400 + elapsed.seconds) * 1_000_000_000 + elapsed.microseconds * 1000


def _from_text(table: TextTable, column: int | str, unit: str) -> Stamps:
    cells = table.texts(column)
    if unit == ISO:
        return _dates(table, column, cells)
    exact = _decimals(cells, _DIGITS[unit]) if unit in _DIGITS else None
    return _scaled(table, column, table.floats([column])[:, 0], unit) if exact is None else exact


def _dates(table: TextTable, column: int | str, cells: NDArray[np.str_]) -> Stamps:
    plain = np.char.rstrip(cells, "Z")
    try:
        return plain.astype("datetime64[ns]").astype(np.int64)
    except ValueError as error:
        row = next(k for k, cell in enumerate(plain.tolist()) if not _is_date(cell))
        where = f"{table.path}: {table.line_of(row)}, column {column}"
        raise DataError(f"{where}: '{cells[row]}' is not a date such as 2024-05-31T12:00:00.01 (UTC)") from error


def _is_date(cell: str) -> bool:
    try:
        np.datetime64(cell, "ns")
    except ValueError:
        return False
    return True


def _decimals(cells: NDArray[np.str_], digits: int) -> Stamps | None:
    """Read plain decimals without rounding: a double holds no nanoseconds of a date. None for other spellings."""
    whole, _, fraction = np.char.partition(cells, ".").T
    if not (np.char.isdecimal(whole).all() and (np.char.isdecimal(fraction) | (fraction == "")).all()):
        return None
    if np.char.str_len(whole).max() + digits > _LONGEST:
        return None
    padded = np.char.ljust(fraction, digits + 1, "0").astype(f"U{digits + 1}")
    # One digit more than there are nanoseconds, to round by.
    return np.asarray(whole.astype(np.int64) * 10**digits + (padded.astype(np.int64) + 5) // 10)


def _from_numbers(table: ArrayTable, column: int | str, unit: str) -> Stamps:
    if unit == ISO:
        raise DataError(f"{table.path}: variable {column}: dates are read from text files only")
    values: NDArray[Any] = table.numbers(column)
    factor = Fraction(_ns_per(unit)).limit_denominator(10**6)
    if values.dtype.kind in "iu" and factor.denominator == 1:
        return np.asarray(values.astype(np.int64) * int(factor))
    return _scaled(table, column, values.astype(np.float64), unit)


def _scaled(table: Table, column: int | str, values: Floats, unit: str) -> Stamps:
    ns = values * _ns_per(unit)
    good = np.isfinite(ns) & (np.abs(ns) < _LARGEST_NS)
    if not good.all():
        row = int(np.argmin(good))
        raise DataError(
            f"{table.path}: {table.line_of(row)}, column {column}: {values[row]} {unit} is not a time; check time.unit"
        )
    return np.asarray(np.rint(ns), np.int64)


def _ns_per(unit: str) -> float:
    return 1.0 if unit == NANOSECONDS else parse_unit(unit).factor * 1e9
