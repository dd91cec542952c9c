"""Which columns of a text file are accelerometers, gyros and times: by their headings, or by their numbers."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.units import UnitError, parse_unit
from sdimu_calibration.storage.importing.text_table import TextTable

_ACCEL = re.compile(r"(linear[ _]?)?acc(el)?(eration|erometer|elerometer)?s?|lin[ _]?acc|specific[ _]?force|a|f")
_GYRO = re.compile(r"gyr(o|oscope|os)?|ang(ular)?[ _]?(vel(ocity)?|rate)|omega|rot(ation)?[ _]?rate|rate|g|w")
_TIME = re.compile(r"(time|timestamp|stamp|t|sec|secs|seconds|epoch|clock|date|datetime|gps|tow)s?")
_COUNTER = re.compile(r"(n_?)?(samples?|count(er)?|index|idx|frame|seq|packet|no|n|#)")
_UNIT_IN = re.compile(r"\s*[\[(]\s*([^\])]+?)\s*[\])]\s*$")
_AXIS = re.compile(r"(?i)(.*?)[ _.\-]?([xyz])(?:[ _.\-]?axis)?[ _.\-]?(\d*)")
_RATE_ABOVE = re.compile(
    r"(?i)(?:\bfs\b|\bodr\b|sampl\w*(?:[ _]?(?:rate|freq\w*))?|\brate\b|freq\w*)[^\d\n]{0,20}(\d+\.?\d*)"
)
_UNITS = {"dps": "deg/s", "mdps": "1e-3 deg/s", "rads": "rad/s", "degs": "deg/s", "m/s2": "m/s^2", "m/s/s": "m/s^2"}
"""Spellings of units in headings that are not those of a map."""
_PLAUSIBLE_HZ = (10.0, 4000.0)
"""Sample rates (Hz) by which the unit of times is told: units a thousand times apart leave no doubt."""
_EVEN = 0.1
"""Largest scatter of the steps of a time (share of the median step) by which it is told without a heading."""
_STEADY = 0.5
"""Scatter of the length of a triple over its median from which it is no force: a hand that turns an IMU makes less."""


class Pair(NamedTuple):
    """Columns of an IMU, from 0, with units where the headings say them; `name` tells several apart."""

    name: str
    accel: tuple[int, int, int]
    gyro: tuple[int, int, int]
    accel_unit: str = ""
    gyro_unit: str = ""


class TimeColumn(NamedTuple):
    """The clock of a file.

    Attributes
    ----------
    column : str
        Heading or number; empty where there is none.
    rate_hz : float
        0 where nothing says it.
    why : str
        How it was recognised.
    """

    column: str
    unit: str
    rate_hz: float
    why: str

    @property
    def known(self) -> bool:
        """Whether the file says the times or the rate."""
        return bool(self.column or self.rate_hz)

    def text(self, rate_hz: float) -> str:
        """Return what the map says of the times; `rate_hz` where there is no column."""
        if not self.column:
            return f"{{rate_hz: {rate_hz:.6g}}}"
        column = self.column if self.column.isdecimal() else f'"{self.column}"'
        return f"{{column: {column}, unit: {self.unit}}}"


def pairs_by_heading(headings: Sequence[str]) -> list[Pair]:
    """Find the accelerometers and gyros that have a heading each; one pair an IMU."""
    found: dict[tuple[str, str], dict[str, tuple[int, str]]] = {}
    for column, heading in enumerate(headings):
        bare, unit = _UNIT_IN.sub("", heading), _unit(heading)
        match = _AXIS.fullmatch(bare.strip())
        kind, which = _kind(match[1], match[3]) if match else ("", "")
        if kind and match:
            found.setdefault((which, kind), {})[match[2].lower()] = (column, unit)
    whole = {key: axes for key, axes in found.items() if len(axes) == 3}
    out = []
    for which in dict.fromkeys(which for which, _ in whole):
        accel, gyro = whole.get((which, "accel")), whole.get((which, "gyro"))
        if accel and gyro:
            out.append(Pair(which or "imu", _columns(accel), _columns(gyro), accel["x"][1], gyro["x"][1]))
    return out


def _columns(axes: Mapping[str, tuple[int, str]]) -> tuple[int, int, int]:
    return axes["x"][0], axes["y"][0], axes["z"][0]


def _kind(stem: str, number: str) -> tuple[str, str]:
    """Tell accelerometers from gyros by what stands before the axis, and name the IMU by what else stands there."""
    words = [word for word in re.split(r"[ _.\-/]+", stem.strip().lower()) if word]
    for kind, pattern in (("accel", _ACCEL), ("gyro", _GYRO)):
        for size in (len(words), 3, 2, 1):
            for at in range(len(words) - size + 1):
                word = " ".join(words[at : at + size])
                digits = re.sub(r"\d+$", "", word)
                if size and pattern.fullmatch(digits):
                    rest = [*words[:at], *words[at + size :], word[len(digits) :], number]
                    return kind, "_".join(part for part in rest if part)
    return "", ""


def _unit(heading: str) -> str:
    match = _UNIT_IN.search(heading)
    if not match:
        return ""
    text = match[1].replace("²", "^2").replace("°", "deg")
    text = _UNITS.get(text.lower(), text)
    try:
        parse_unit(text)
    except UnitError:
        return ""
    return text


def pairs_by_numbers(numbers: Floats) -> list[Pair]:
    """Find the accelerometers as the three columns side by side whose length changes least, and the gyros beside them.

    Parameters
    ----------
    numbers : ndarray, shape (n, k)
    """
    usable = [
        k for k in range(numbers.shape[1]) if np.isfinite(numbers[:, k]).mean() > 0.9 and not _clock(numbers[:, k])
    ]
    triples = [
        (usable[k], usable[k] + 1, usable[k] + 2) for k in range(len(usable) - 2) if usable[k + 2] == usable[k] + 2
    ]
    if len(usable) < 6 or not triples:
        return []

    def unsteady(triple: tuple[int, int, int]) -> float:
        size = np.linalg.norm(numbers[:, list(triple)], axis=1)
        middle = float(np.nanmedian(size))
        return float(np.nanmedian(np.abs(size - middle)) / middle) if middle > 0.0 else np.inf

    edge = [t for t in triples if (t[0] - usable[0]) % 3 == 0]
    accel = min(edge, key=unsteady)
    beside = [t for t in edge if abs(t[0] - accel[0]) == 3]
    if unsteady(accel) > _STEADY or not beside:
        return []
    return [Pair("imu", accel, max(beside, key=unsteady))]


def _clock(values: Floats) -> bool:
    """Whether numbers ascend by even steps."""
    step = np.diff(values)
    usual = float(np.median(step)) if len(step) else 0.0
    return bool(len(step) and usual > 0.0 and np.mean(np.abs(step - usual) <= max(_EVEN * usual, 1e-12)) > 0.5)


def time_of(table: TextTable, numbers: Floats, pairs: Sequence[Pair]) -> TimeColumn:
    """Find the column of times, or the rate that the lines above the data state.

    Parameters
    ----------
    numbers : ndarray, shape (n, k)
    """
    taken = {k for pair in pairs for k in (*pair.accel, *pair.gyro)}
    free = [k for k in range(numbers.shape[1]) if k not in taken]
    named = [k for k in free if k < len(table.headings) and _TIME.fullmatch(_words(table.headings[k]))]
    counters = [k for k in free if k < len(table.headings) and _COUNTER.fullmatch(_words(table.headings[k]))]
    for k in dict.fromkeys([*named, *(k for k in free if k not in counters and _clock(numbers[:, k]))]):
        column = (
            table.headings[k]
            if k < len(table.headings) and table.headings.count(table.headings[k]) == 1
            else str(k + 1)
        )
        if not np.isfinite(numbers[:, k]).any():
            return TimeColumn(column, "iso8601", 0.0, f"column {column} holds dates")
        step = float(np.nanmedian(np.diff(numbers[:, k])))
        for unit, seconds in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)):
            rate = 1.0 / (step * seconds) if step > 0.0 else 0.0
            if _PLAUSIBLE_HZ[0] <= rate <= _PLAUSIBLE_HZ[1]:
                return TimeColumn(column, unit, rate, f"column {column} in {unit}, {rate:.5g} Hz")
    for line in table.above:
        match = _RATE_ABOVE.search(line)
        if match and _PLAUSIBLE_HZ[0] <= float(match[1]) <= _PLAUSIBLE_HZ[1]:
            return TimeColumn("", "", float(match[1]), f"{match[1]} Hz by '{line.strip()}' above the data")
    counted = f" (column {table.headings[counters[0]]} counts samples)" if counters else ""
    return TimeColumn("", "", 0.0, f"no column of times and no rate is in the file{counted}")


def _words(heading: str) -> str:
    """Words of a heading without its unit."""
    return re.sub(r"[ _.\-]+(s|ms|us|ns|sec|utc|unix)$", "", _UNIT_IN.sub("", heading).strip().lower())
