"""Which columns of a text file are accelerometers and gyros, by their headings."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import UnitError, parse_unit
from sdimu_calibration.storage.importing.column_scales import is_gravity, median_size

Three = tuple[int, int, int]
"""Columns of the axes x, y, z, from 0."""

_ACCEL = re.compile(r"(linear[ _]?)?acc(el)?(eration|erometer|elerometer)?s?|lin[ _]?acc|specific[ _]?force|a|f")
_GYRO = re.compile(r"gyr(o|oscope|os)?|ang(ular)?[ _]?(vel(ocity)?|rate)|omega|rot(ation)?[ _]?rate|rate|g|w")
_UNIT_IN = re.compile(r"\s*[\[(]\s*([^\])]+?)\s*[\])]\s*$")
_AXIS = re.compile(r"(?i)(.*?)[ _.\-]?([xyz])(?:[ _.\-]?axis)?[ _.\-]?(\d*)")
_UNITS = {"dps": "deg/s", "rads": "rad/s", "degs": "deg/s", "m/s2": "m/s^2", "m/s/s": "m/s^2"}
"""Spellings of units in headings that are not those of a map."""


class Pair(NamedTuple):
    """Columns of an IMU, from 0, with units where the headings say them; `name` tells several apart."""

    name: str
    accel: Three
    gyro: Three
    accel_unit: str = ""
    gyro_unit: str = ""
    doubt: str = ""
    """What of the choice the user has to look at."""


class Named(NamedTuple):
    """Three columns whose headings call them one sensor."""

    which: str
    """What tells the IMU from others in the file."""
    columns: Three
    unit: str


def sensors_by_heading(headings: Sequence[str]) -> tuple[list[Named], list[Named]]:
    """Find all accelerometers, and all gyros, that have a heading for each axis."""
    found: dict[tuple[str, str, str], list[tuple[str, int, str]]] = {}
    for column, heading in enumerate(headings):
        match = _AXIS.fullmatch(_UNIT_IN.sub("", heading).strip())
        key = _kind(match[1], match[3]) if match else ("", "", "")
        if match and key[0]:
            found.setdefault(key, []).append((match[2].lower(), column, _unit(heading)))
    # Two columns of one name are not told apart by it.
    whole = [(key, sorted(axes)) for key, axes in found.items() if sorted(axis for axis, _, _ in axes) == list("xyz")]
    accel, gyro = (
        [Named(which, (x[1], y[1], z[1]), x[2]) for (kind, _, which), (x, y, z) in whole if kind == wanted]
        for wanted in ("accel", "gyro")
    )
    return accel, gyro


def pairs_by_heading(
    headings: Sequence[str], numbers: Floats, accel: Sequence[Named], gyro: Sequence[Named]
) -> list[Pair]:
    """Put accelerometers and gyros together; one pair an IMU.

    Parameters
    ----------
    numbers : ndarray, shape (n, k)
    accel, gyro : sequence of Named
        As `sensors_by_heading` finds them. Those without a partner of their name share the only one of the other kind.

    Raises
    ------
    DataError
        Several columns may be one sensor.
    """
    out = []
    for which in dict.fromkeys(one.which for one in (*accel, *gyro)):
        forces = _that_may_be([one for one in accel if one.which == which], numbers, force=True)
        rates = _that_may_be([one for one in gyro if one.which == which], numbers, force=False)
        out += [(one, other) for one in forces for other in rates]
        for several in (forces, rates):
            if forces and rates and len(several) > 1:
                names = " and ".join(", ".join(headings[k] for k in one.columns) for one in several)
                raise DataError(f"the columns {names} may be one sensor: name three of them")
    if not out and 1 in (len(accel), len(gyro)):
        out = [(one, other) for one in accel for other in gyro]
    return [_pair(one, other) for one, other in out]


def _pair(accel: Named, gyro: Named) -> Pair:
    name = accel.which or gyro.which or "imu"
    return Pair(name, accel.columns, gyro.columns, accel.unit, gyro.unit)


def _that_may_be(sensors: list[Named], numbers: Floats, force: bool) -> list[Named]:
    """Leave out, where several have one name, those that never change, and forces whose size is not gravity's."""
    if len(sensors) < 2:
        return sensors
    moving = [one for one in sensors if changes(numbers[:, list(one.columns)]).any()]
    if force and len(moving) > 1:
        moving = [one for one in moving if is_gravity(median_size(numbers[:, list(one.columns)]))] or moving
    return moving


def changes(numbers: Floats) -> Bools:
    """Whether each column, shape (n, k), holds more than one number; shape (k,)."""
    lowest = np.min(numbers, axis=0, where=np.isfinite(numbers), initial=np.inf)
    highest = np.max(numbers, axis=0, where=np.isfinite(numbers), initial=-np.inf)
    return np.asarray(lowest < highest)


def _kind(stem: str, number: str) -> tuple[str, str, str]:
    """Tell accelerometers from gyros by what stands before the axis, and name the IMU by what else stands there.

    Gives the sensor, the word that says it, and the name of the IMU; empty where none is told.
    """
    words = [word for word in re.split(r"[ _.\-/]+", stem.strip().lower()) if word]
    best = "", "", ""
    for kind, pattern in (("accel", _ACCEL), ("gyro", _GYRO)):
        for at, end in [(at, at + size) for size in (1, 2) for at in range(len(words))]:
            word = " ".join(words[at:end])
            digits = re.sub(r"\d+$", "", word)
            # The longest word says it: the a of an "imu a" is no acceleration beside a gyro.
            if pattern.fullmatch(digits) and len(digits) > len(best[1]):
                rest = [*words[:at], *words[end:], word[len(digits) :], number]
                best = kind, digits, "_".join(part for part in rest if part)
    return best


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
