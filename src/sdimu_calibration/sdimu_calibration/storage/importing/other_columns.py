"""What else a file without a map holds that an import can take: what is a rest, and the temperature."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.storage.importing.import_map import RESTS, is_rest
from sdimu_calibration.storage.importing.text_table import column_text
from sdimu_calibration.storage.importing.time_column import Table

_PHASE = re.compile(r"(is|in|at)?[ _.\-]*(phase|label|state|status|motion|activity|mode|rest|static|still|dwell)s?")
"""Headings of a column that says when the IMU rests."""
_SAYS_REST = re.compile(r"(is|in|at)?[ _.\-]*(rest|static|still|dwell)s?")
"""Those of them that mean a rest by 1 or true: of a state nobody knows which number it is, a motion means the other."""
_TRUTHS = ("true", "1")
_MOST_WORDS = 1000
"""Number of different words of a column at most: more are no phases of a test."""
_TEMPERATURE = re.compile(r"(imu|sensor|gyro|accel|chip|board|die)?[ _.\-]*(t|temp|temps|temperature)")
_UNIT = re.compile(r"[ _.\-]*[\[(]?[ _.\-]*(°c|degc|deg_c|celsius|c|k|kelvin)[ _.\-]*[\])]?")
_KELVIN = ("k", "kelvin")
_PLAUSIBLE = {"degC": (-80.0, 150.0), "K": (193.0, 423.0)}
"""Temperatures at which an IMU is tested, by unit: counts of a converter are none."""


class Other(NamedTuple):
    """A column beside the sensors and the times."""

    line: str
    """What the map says of it."""
    column: int | str
    why: str
    """How it was recognised."""


def phase_of(table: Table, rows: int, taken: Sequence[int]) -> Other | None:
    """Find the column that says what is a rest; None where none does in words that a map knows.

    Parameters
    ----------
    rows : int
        Number of samples.
    taken : sequence of int
        Columns, from 0, that are known to be something else.
    """
    for name, heading, words in _labels(table, taken):
        known = np.unique(words).tolist() if len(words) == rows and _PHASE.fullmatch(heading) else []
        mean = RESTS if _SAYS_REST.fullmatch(heading) else [word for word in RESTS if word not in _TRUTHS]
        rests = [word for word in known if is_rest(word, mean)]
        if not 0 < len(rests) < len(known) <= _MOST_WORDS:
            continue
        shown = ", ".join(f"'{word}'" for word in rests)
        return Other(f"phase: {{column: {column_text(name)}}}", name, f"column {name} says a rest by {shown}")
    return None


def temperature_of(table: Table, numbers: Floats, taken: Sequence[int]) -> Other | None:
    """Find the column of the temperature; None where none is called one, several are, or its numbers are none.

    Parameters
    ----------
    numbers : ndarray, shape (n, k)
    taken : sequence of int
        Columns, from 0, that are known to be something else.
    """
    found = []
    for k, heading in enumerate(table.headings):
        name, unit = _parted(heading)
        values = numbers[:, k] if k < numbers.shape[1] else np.empty(0)
        values = values[np.isfinite(values)]
        # A T alone is a time as well.
        if k in taken or not len(values) or not _TEMPERATURE.fullmatch(name) or (name == "t" and not unit):
            continue
        low, high = _PLAUSIBLE[unit or "degC"]
        if low < values.min() and values.max() < high:
            found.append(
                Other(
                    f"temperature: {{column: {column_text(table.name_of(k))}, unit: {unit or 'degC'}}}",
                    table.name_of(k),
                    f"column {table.name_of(k)} in {unit or 'degC'}, by its heading and its numbers",
                )
            )
    return found[0] if len(found) == 1 else None


def _labels(table: Table, taken: Sequence[int]) -> list[tuple[int | str, str, NDArray[np.str_]]]:
    """Columns that may say what is a rest: name in a map, heading in small letters, and words, shape (n,)."""
    out = [
        (table.name_of(k), heading.strip().lower(), table.words(k))
        for k, heading in enumerate(table.headings)
        if k not in taken and _PHASE.fullmatch(heading.strip().lower())
    ]
    return out + [(name, name.rpartition(".")[2].lower(), words) for name, words in table.labels().items()]


def _parted(heading: str) -> tuple[str, str]:
    """Split a heading in small letters into its name and the unit of a temperature; empty where it says none."""
    text = heading.strip().lower()
    for at in range(1, len(text)):
        match = _UNIT.fullmatch(text[at:])
        if match and not text[at].isalnum() and _TEMPERATURE.fullmatch(text[:at]):
            return text[:at], "K" if match[1] in _KELVIN else "degC"
    return text, ""
