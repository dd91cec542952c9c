"""The clock of a text file without a map: a column of times, or the rate that the lines above the data state."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.storage.importing.array_columns import ArrayColumns
from sdimu_calibration.storage.importing.import_stamps import is_date
from sdimu_calibration.storage.importing.text_table import TextTable, column_text

Table = TextTable | ArrayColumns
"""What a map is proposed for: columns of a text file, or of a file of arrays."""

_TIME = re.compile(r"(time|timestamp|stamp|t|sec|secs|seconds|epoch|clock|date|datetime|gps|tow)s?")
_COUNTER = re.compile(r"(n_?)?(samples?|count(er)?|index|idx|frame|seq|packet|no|n|#)")
_UNIT_SAID = re.compile(r"(?:[ _.\-]+|\s*[\[(]\s*)(s|ms|us|µs|ns|sec)\s*[\])]?$")
_BEHIND = re.compile(r"[ _.\-]+(s|ms|us|ns|sec|utc|unix)$")
_BRACKET = re.compile(r"\s*[\[(]\s*([^\])]+?)\s*[\])]\s*$")
_RATE_ABOVE = re.compile(
    r"(?i)(?:\bfs\b|\bodr\b|sampl\w*(?:[ _]?(?:rate|freq\w*))?|\brate\b|freq\w*)[^\d\n]{0,20}(\d+\.?\d*)"
)
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_SPELLINGS = {"sec": "s", "µs": "us"}
_PLAUSIBLE_HZ = (10.0, 4000.0)
"""Sample rates (Hz) by which the unit of times is told: units a thousand times apart leave no doubt."""
_EVEN = 0.1
"""Largest scatter of the steps of a time (share of the median step) by which it is told without a heading."""


class TimeColumn(NamedTuple):
    """The clock of a file."""

    column: int | str
    """Heading, or number from 1; empty where there is none."""
    unit: str
    rate_hz: float
    """0 where nothing says it."""
    why: str
    """How it was recognised."""

    @property
    def known(self) -> bool:
        """Whether the file says the times or the rate."""
        return bool(self.column or self.rate_hz)

    def text(self, rate_hz: float) -> str:
        """Return what the map says of the times; `rate_hz` where there is no column."""
        if not self.column:
            return f"{{rate_hz: {rate_hz:.6g}}}"
        return f"{{column: {column_text(self.column)}, unit: {self.unit}}}"


def time_of(table: Table, numbers: Floats, taken: Sequence[int] = ()) -> TimeColumn:
    """Find the column of times, or the rate that the lines above the data state.

    Parameters
    ----------
    numbers : ndarray, shape (n, k)
    taken : sequence of int
        Columns, from 0, that are known to be something else.
    """
    free = [k for k in range(numbers.shape[1]) if k not in set(taken)]
    headings = {k: table.headings[k] for k in free if k < len(table.headings)}
    named = [k for k, heading in headings.items() if _TIME.fullmatch(_words(heading))]
    counters = [k for k, heading in headings.items() if _COUNTER.fullmatch(_words(heading))]
    counters += [k for k in free if k not in (*named, *counters) and counts(numbers[:, k])]
    ticking = [k for k in free if k not in (*named, *counters) and ticks(numbers[:, k])]
    for k in (*named, *ticking):
        found = _clock(table, k, numbers[:, k])
        if found is not None:
            return found
    for line in table.above:
        match = _RATE_ABOVE.search(line)
        if match and _plausible(float(match[1])):
            return TimeColumn("", "", float(match[1]), f"{match[1]} Hz by '{line.strip()}' above the data")
    more = [f"column {table.name_of(k)} counts samples" for k in counters[:1]]
    more += [f"column {table.name_of(k)} is called a time, and its numbers do not go up as one" for k in named[:1]]
    told = f" ({', '.join(more)})" if more else ""
    return TimeColumn("", "", 0.0, f"no column of times and no rate is in the file{told}")


def ticks(values: Floats) -> bool:
    """Whether numbers, shape (n,), ascend by even steps."""
    step, usual = _steps(values)
    return usual > 0.0 and bool((np.abs(step - usual) <= max(_EVEN * usual, 1e-12)).mean() > 0.5)


def counts(values: Floats) -> bool:
    """Whether numbers, shape (n,), go up by one, as the index of a row does."""
    step, usual = _steps(values)
    return usual == 1.0 and ticks(values) and bool((step == np.rint(step)).all())


def _steps(values: Floats) -> tuple[Floats, float]:
    """Return the steps between the numbers of a column, and the usual one; 0 where there is none."""
    step = np.diff(values[np.isfinite(values)])
    return step, float(np.median(step)) if len(step) else 0.0


def _clock(table: Table, k: int, values: Floats) -> TimeColumn | None:
    """Read a column, from 0, as a clock; None where it is none."""
    column = table.name_of(k)
    if not np.isfinite(values).any():
        dates = is_date(str(table.texts(k + 1)[0]))
        return TimeColumn(column, "iso8601", 0.0, f"column {column} holds dates") if dates else None
    _, usual = _steps(values)
    if usual <= 0.0:
        return None
    rates = {unit: 1.0 / (usual * seconds) for unit, seconds in _SECONDS.items()}
    said = _unit_said(table.headings[k] if k < len(table.headings) else "")
    unit = next((unit for unit in (said, *rates) if unit and _plausible(rates[unit])), said)
    if not unit:
        return None
    why = f"column {column} in {unit}, {rates[unit]:.5g} Hz"
    if said and said != unit:
        why += f", though its heading says {said}, which would be {rates[said]:.5g} Hz: check it"
    if not said and counts(values):
        why += ", as its numbers go up by one: if they count samples, write rate_hz in its place"
    return TimeColumn(column, unit, rates[unit], why)


def _plausible(rate_hz: float) -> bool:
    return _PLAUSIBLE_HZ[0] <= rate_hz <= _PLAUSIBLE_HZ[1]


def _unit_said(heading: str) -> str:
    """Find the unit of time in a heading; empty where it says none."""
    match = _UNIT_SAID.search(heading.strip().lower().replace("μ", "µ"))
    return _SPELLINGS.get(match[1], match[1]) if match else ""


def _words(heading: str) -> str:
    """Words of a heading without its unit."""
    return _BEHIND.sub("", _BRACKET.sub("", heading).strip().lower())
