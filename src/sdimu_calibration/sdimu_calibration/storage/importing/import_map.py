"""The map that says what the columns of a file from elsewhere are (format ``sdimu-import/1``): doc/recordings.md."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import datetime
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import parse_unit
from sdimu_calibration.storage.files.config import Schema, find_config, read_yaml

ISO = "iso8601"
"""Unit of times written as dates."""
NANOSECONDS = "ns"


_TICK = re.compile(r"([1-9]\d*)\s*(\w+)")


def unit_of(*expected: str) -> BeforeValidator:
    """Take a unit of the dimension of one of `expected`."""

    def check(value: Any) -> str:
        text = str(value)
        if all(parse_unit(text).dimension != parse_unit(unit).dimension for unit in expected):
            raise ValueError(f"'{text}' is the wrong unit (expected something like '{expected[0]}')")
        return text

    return BeforeValidator(check)


def tick(text: str) -> tuple[int, str]:
    """Split a unit of time such as ``10ms`` into a whole number and the unit."""
    match = _TICK.fullmatch(text)
    return (int(match.group(1)), match.group(2)) if match else (1, text)


def _time_unit(value: Any) -> str:
    text = str(value)
    name = tick(text)[1]
    if text != ISO and name != NANOSECONDS and parse_unit(name).dimension != parse_unit("s").dimension:
        raise ValueError(f"'{text}' is the wrong unit (expected something like 's', '10ms' or '{ISO}')")
    return text


def _three(value: Any) -> Any:
    """Let one number stand for all three axes."""
    return (value,) * 3 if isinstance(value, int | float) and not isinstance(value, bool) else value


def _listed(value: Any) -> Any:
    """Let one name stand for a list of one: a variable of three columns."""
    return (value,) if isinstance(value, str | int) else value


def _no_truth(value: Any) -> Any:
    """Refuse ``true`` and ``yes``, which YAML does not read as words, and which would be column 1."""
    if isinstance(value, bool):
        raise ValueError(f"{str(value).lower()} names no column: write a heading of this name between quotes")
    return value


def _one_character(value: str) -> str:
    if len(value) != 1 or value in '\r\n"#%':
        raise ValueError(f"{value!r} cannot stand between columns: give one character, such as ';'")
    return value


Column = Annotated[int | str, Field(union_mode="left_to_right"), BeforeValidator(_no_truth)]
Three = Annotated[tuple[float, float, float], BeforeValidator(_three)]
Sign = Literal[1, -1]


class TimeMap(Schema):
    """Where the times are."""

    column: Column | None = None
    """Number from 1, heading, or variable."""
    unit: Annotated[str, BeforeValidator(_time_unit)] = "s"
    """Of time (s, ms, us, ns, min, h), a whole number of it (``10ms``), or ``iso8601``."""
    start: datetime | None = None
    """The moment at which the column is zero (UTC unless it says otherwise); 1970 when it is left out."""
    rate_hz: float | None = Field(default=None, gt=0.0)
    """In place of a column: samples come at this rate."""
    counter: Column | None = None
    """Column that counts the samples: it is the clock, at `rate_hz` or at the rate that the times in `column` have in
    the mean. What it leaves out is missing."""

    @model_validator(mode="after")
    def _one_of_two(self) -> TimeMap:
        if (self.column is None) == (self.rate_hz is None):
            raise ValueError("give either column or rate_hz")
        return self


class SensorMap(Schema):
    """Three axes of one kind of sensor: value = sign * (raw - bias) / counts_per_unit, in `unit`.

    A unit of angle, or of velocity, means increments over the interval of the samples.
    """

    columns: Annotated[tuple[Column, ...], BeforeValidator(_listed)]
    """Three, or one variable with three columns."""
    unit: str
    file: str | None = None
    """Pattern of the name of the file that holds them; needed when several files are given."""
    time: Column | None = None
    """Column of the times, where it is not the common one."""
    counts_per_unit: Three = (1.0, 1.0, 1.0)
    bias: Three = (0.0, 0.0, 0.0)
    """`counts_per_unit`, `bias`: raw counts; the bias is the nominal one, such as half of the converter's range."""
    sign: Annotated[tuple[Sign, Sign, Sign], BeforeValidator(_three)] = (1, 1, 1)

    @model_validator(mode="after")
    def _three_columns(self) -> SensorMap:
        if len(self.columns) not in {1, 3}:
            raise ValueError("columns: expected three, or one variable with three columns")
        if 0.0 in self.counts_per_unit:
            raise ValueError("counts_per_unit: zero")
        return self

    @property
    def factor(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """SI per raw count with its sign, shape (3,)."""
        return np.asarray(np.array(self.sign) * parse_unit(self.unit).factor / np.array(self.counts_per_unit), float)

    @property
    def increments(self) -> bool:
        """Whether the numbers are what a sample adds to an angle or a velocity."""
        return parse_unit(self.unit).dimension in {parse_unit("rad").dimension, parse_unit("m/s").dimension}


class AccelMap(SensorMap):
    """Specific force."""

    unit: Annotated[str, unit_of("m/s^2", "m/s")]


class GyroMap(SensorMap):
    """Body rate."""

    unit: Annotated[str, unit_of("deg/s", "deg")]


class TemperatureMap(Schema):
    """Temperature of the IMU: value = (raw - bias) / counts_per_unit, in `unit` (degC or K)."""

    column: Column
    unit: Literal["degC", "K"] = "degC"
    file: str | None = None
    time: Column | None = None
    counts_per_unit: float = 1.0
    bias: float = 0.0


def _words(value: Any) -> Any:
    """Let one word stand for a list of one, and a number for its word."""
    return tuple(f"{one:g}" if isinstance(one, int | float) else one for one in _each(value))


def _each(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [value]


RESTS = ("rest", "dwell", "static", "still", "true", "1")
"""What a column says at rest where the map does not name its words."""


def is_rest(label: str, words: Sequence[str]) -> bool:
    """Whether a label is one of some words, ``*`` standing for anything, in large letters or small ones."""
    return any(fnmatchcase(label.lower(), word.lower()) for word in words)


class PhaseMap(Schema):
    """Which rows are at rest."""

    column: Column
    """Holds a word or a number."""
    rest: Annotated[tuple[str, ...], BeforeValidator(_words)] = RESTS
    """What it says at rest; ``*`` stands for anything (``pos*``). Another word of them begins another rest."""
    file: str | None = None
    """As of a sensor."""


class BinaryMap(Schema):
    """Numbers of one kind in a file, row after row, without anything else."""

    type: Literal["float64", "float32", "int64", "int32", "int16"]
    columns: int = Field(gt=0)
    """Numbers of a row."""
    big_endian: bool = False
    skip_bytes: int = Field(default=0, ge=0)
    """Before the first number."""


class ImportMap(Schema):
    """What the columns of the files are."""

    format: Literal["sdimu-import/1"]
    name: str | None = None
    time: TimeMap
    accel: AccelMap
    gyro: GyroMap
    temperature: TemperatureMap | None = None
    phase: PhaseMap | None = None
    delimiter: Annotated[str, AfterValidator(_one_character)] | None = None
    """Between the columns of a text file; recognised when left out."""
    decimal: Literal[".", ","] | None = None
    """Decimal sign of a text file; recognised when left out."""
    skip_lines: int | None = Field(default=None, ge=0)
    """Lines before the data of a text file, the last of them with the headings; recognised when left out."""
    binary: BinaryMap | None = None
    """Of files that are neither text nor MAT nor NPZ."""


def load_import_map(name_or_path: str | Path) -> ImportMap:
    """Read a map: a name in config/import, or a path."""
    path = find_config("import", name_or_path)
    found = read_yaml(path, ImportMap)
    if found.decimal == "," and found.delimiter == ",":
        raise DataError(f"{path}: delimiter: cannot be the decimal sign too")
    return found
