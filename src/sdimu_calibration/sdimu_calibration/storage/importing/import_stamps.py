"""Times of a file from elsewhere as stamps: exact to the nanosecond where the file is."""

from __future__ import annotations

from datetime import datetime, timezone
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.data.bursts import find_bursts
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import parse_unit
from sdimu_calibration.storage.importing.array_table import ArrayTable
from sdimu_calibration.storage.importing.import_map import ISO, NANOSECONDS, TimeMap, tick
from sdimu_calibration.storage.importing.text_table import MOST_BROKEN, TextTable

Stamps = Ints
Table = TextTable | ArrayTable

_DIGITS = {"s": 9, "ms": 6, "us": 3, "ns": 0}
"""Decimal places of a nanosecond in each unit."""
_LONGEST = 19
"""Digits of a number of nanoseconds in 64 bits."""
_NEAR_EDGE = 0.02
"""Share of a power of two below it that a counter which ends there may not have reached: samples missing at its end."""
_FAR = 3.0
"""Number of intervals by which a lone stamp lies outside its neighbours: late messages are less out of order."""
_BACK = 4.0
"""Number of intervals from which a step back is told: what comes late is less, and a bag takes out smaller steps."""
_PASSES = 10
"""Number of looks for lone stamps at most: what shows more behind each that is taken out is no accident."""
_LARGEST_NS = 4e18
"""Times beyond this (the year 2096) do not fit a stamp."""


def read_stamps(table: Table, column: int | str | None, time: TimeMap, samples: int) -> tuple[Stamps, tuple[str, ...]]:
    """Read the stamps of a table.

    Parameters
    ----------
    column : int or str or None
        None makes them from the rate.
    samples : int
        How many there must be.

    Returns
    -------
    ns : ndarray of int64, shape (n,)
        Since 1970 (ns).
    notes : tuple of str
        What the stamps are, where it is not what the file says.
    """
    notes: tuple[str, ...] = ()
    if column is None:
        assert time.rate_hz is not None
        ns = np.rint(np.arange(1, samples + 1) * (1e9 / time.rate_hz)).astype(np.int64)
    elif isinstance(table, TextTable):
        ns = _from_text(table, column, time.unit)
    else:
        ns = _from_numbers(table, column, time.unit)
    if len(ns) != samples:
        raise DataError(
            f"{table.path}: column {column} has {len(ns)} times, and there are {samples} samples: name the times of "
            "these samples in the map (time.column, or time of the sensor), or state time.rate_hz"
        )
    if time.counter is not None:
        ns, notes = counted(table, time.counter, ns, time.rate_hz)
    start_ns = _start_ns(time.start)
    far = np.abs(ns.astype(np.float64) + start_ns) > _LARGEST_NS
    if far.any():
        where = f"{table.line_of(int(np.argmax(far)))}, column {column}"
        raise DataError(f"{table.path}: {where}: a time not between 1970 and 2096; check time.unit and time.start")
    ns = ns + start_ns
    if (ns < 0).any():
        row = int(np.argmax(ns < 0))
        raise DataError(f"{table.path}: {table.line_of(row)}, column {column}: a time before 1970; check time.start")
    return np.asarray(ns, np.int64), (*notes, *(() if notes else _proposed(ns)))


def set_back(table: Table, column: int | str, ns: Stamps) -> tuple[str, ...]:
    """Say where times go back and stay there: what follows covers times that other samples have.

    Parameters
    ----------
    column : int or str
        Of the times.
    ns : ndarray of int64, shape (n,)
        Stamps (ns), those that are lone left out.
    """
    step = np.diff(ns)
    usual = float(np.median(step)) if len(step) else 0.0
    after = np.flatnonzero(step[:-1] < -_BACK * max(usual, 0.0)) + 1
    stays = after[ns[after + 1] < ns[after - 1]]
    if not len(stays) or usual <= 0.0:
        return ()
    back = 1e-9 * float(ns[stays[0] - 1] - ns[stays[0]])
    more = f", and at {len(stays) - 1} more places" if len(stays) > 1 else ""
    return (
        f"{table.path}: {table.line_of(int(stays[0]))}, column {column}: the times go back by {back:.3g} s{more}: what "
        "follows has the times of samples before it, and will pass for another sensor; if the clock was set, state "
        "time.rate_hz or time.counter in the map, else make a file of each part",
    )


def lone_stamps(ns: Stamps) -> Ints:
    """Find stamps that cannot be right, such as one that lost its decimal point.

    Parameters
    ----------
    ns : ndarray of int64, shape (n,)

    Returns
    -------
    ndarray of int64, shape (m,)
        Rows with a stamp far from its neighbours, which follow one another as if one sample lay between them; the first
        row where it is far behind the second, and the last where it is far before the last but one. None where there
        are many: they are no accidents.
    """
    rows = np.arange(len(ns))
    for _ in range(_PASSES):
        lone = _lone(ns[rows])
        if not lone.any():
            left_out = np.delete(np.arange(len(ns)), rows)
            return left_out if len(left_out) <= max(1.0, MOST_BROKEN * len(ns)) else np.zeros(0, np.int64)
        rows = rows[~lone]
    return np.zeros(0, np.int64)


def _lone(ns: Stamps) -> Bools:
    """Whether each stamp, shape (n,), is far from its neighbours."""
    out = np.zeros(len(ns), np.bool_)
    usual = float(np.median(np.diff(ns))) if len(ns) > 2 else 0.0
    if usual > 0.0:
        far = _FAR * usual
        apart = (ns[2:] - ns[:-2]) / usual
        outside = (ns[1:-1] < ns[:-2] - far) | (ns[1:-1] > ns[2:] + far)
        out[1:-1] = (apart > 1.5) & (apart < 2.5) & outside
        out[0], out[-1] = ns[0] > ns[1] + far, ns[-1] < ns[-2] - far
    return out


def _proposed(ns: Stamps) -> tuple[str, ...]:
    """Say how stamps that are no sample times may be replaced."""
    bursts = find_bursts(ns)
    if bursts is None:
        return ()
    more = f"rate_hz: {bursts.rate_hz:.5g} in the map, or time.counter where the file counts its samples, says it"
    return (f"{bursts}; {more}",)


def counted(table: Table, column: int | str, ns: Stamps, rate_hz: float | None) -> tuple[Stamps, tuple[str, ...]]:
    """Make stamps of a counter of the samples.

    Parameters
    ----------
    column : int or str
        It may begin again at a power of two, or at its largest number, and count by more than one.
    ns : ndarray of int64, shape (n,)
        Times of the file (ns), for the rate and the beginning.
    rate_hz : float or None
        Of the samples; None takes that of `ns` in the mean.
    """
    raw = table.floats([column])[:, 0]
    whole = np.isfinite(raw) & (raw == np.rint(raw))
    if len(raw) < 2 or not whole.all():
        row = int(np.argmin(whole))
        raise DataError(
            f"{table.path}: {table.line_of(row)}, column {column}: {raw[row]} does not count samples (expected a whole "
            "number)"
        )
    count, by = _unwrapped(raw.astype(np.int64))
    if by < 1 or (np.diff(count) < 0).any():
        raise DataError(f"{table.path}: column {column} does not count the samples; check time.counter in the map")
    number = (count - count[0]) / by
    if rate_hz is None:
        interval = float(np.polyfit(number, (ns - ns[0]).astype(np.float64), 1)[0])
    else:
        interval = 1e9 / rate_hz
    missing = int(number[-1]) + 1 - len(np.unique(count))
    note = f"column {column} is the clock, at {1e9 / interval:.6g} Hz; by it {missing} samples are missing"
    return np.asarray(ns[0] + np.rint(number * interval).astype(np.int64)), (note,)


def _unwrapped(count: Stamps) -> tuple[Stamps, int]:
    """Go on where a counter begins again, and say by how much it counts."""
    step = np.diff(count)
    falls = step < 0
    by = int(np.median(step[~falls])) if not falls.all() else 0
    largest = int(count.max())
    # At a power of two, of which the last numbers may be missing, or at another number.
    near = [edge for edge in (2**bits for bits in (8, 16, 32)) if 0 < edge - largest <= _NEAR_EDGE * edge]
    edge = near[0] if near else largest + by
    return np.asarray(count + np.concatenate([[0], np.cumsum(falls)]) * edge), by


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
    number, name = tick(unit)
    exact = _decimals(cells, _DIGITS[name]) if name in _DIGITS else None
    if exact is None or exact.max(initial=0) > _LARGEST_NS / number:
        return _scaled(table, column, table.floats([column])[:, 0], unit)
    return exact * number


def _dates(table: TextTable, column: int | str, cells: NDArray[np.str_]) -> Stamps:
    plain = np.char.rstrip(cells, "Z")
    try:
        return plain.astype("datetime64[ns]").astype(np.int64)
    except ValueError as error:
        row = next(k for k, cell in enumerate(plain.tolist()) if not is_date(cell))
        where = f"{table.path}: {table.line_of(row)}, column {column}"
        raise DataError(f"{where}: '{cells[row]}' is not a date such as 2024-05-31T12:00:00.01 (UTC)") from error


def is_date(cell: str) -> bool:
    """Whether a cell is a date such as 2024-05-31T12:00:00.01 (UTC)."""
    try:
        return not np.isnat(np.datetime64(cell.rstrip("Z"), "ns"))
    except ValueError:
        return False


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
    values: NDArray[Any] = table.numbers(column)
    if values.dtype.kind == "M":
        # A date is one in every unit.
        return np.asarray(values.astype("datetime64[ns]").astype(np.int64))
    if unit == ISO:
        raise DataError(f"{table.path}: variable {column} holds no dates; check time.unit")
    factor = Fraction(_ns_per(unit)).limit_denominator(10**6)
    if values.dtype.kind in "iu" and factor.denominator == 1:
        return np.asarray(values.astype(np.int64) * int(factor))
    return _scaled(table, column, values.astype(np.float64), unit)


def _scaled(table: Table, column: int | str, values: Floats, unit: str) -> Stamps:
    with np.errstate(over="ignore"):
        ns = values * _ns_per(unit)
    good = np.isfinite(ns) & (np.abs(ns) < _LARGEST_NS)
    if not good.all():
        row = int(np.argmin(good))
        raise DataError(
            f"{table.path}: {table.line_of(row)}, column {column}: {values[row]} {unit} is not a time; check time.unit"
        )
    return np.asarray(np.rint(ns), np.int64)


def _ns_per(unit: str) -> float:
    number, name = tick(unit)
    return number * (1.0 if name == NANOSECONDS else parse_unit(name).factor * 1e9)
