"""Objects of MATLAB (timetable, table, datetime, duration) and files of version 7.3 as plain arrays, by matio.

matio gives the properties of an object as MATLAB stores them. Of a timetable they are its variables and the times of
its rows, of a datetime the milliseconds since 1970 as a sum of two doubles, of a duration its milliseconds. Source: the
readers of matio (`matio.utils.converters`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

_HDF5 = b"\x89HDF\r\n\x1a\n"
_HDF5_AT = 512
HEAD = _HDF5_AT + len(_HDF5)
"""Number of bytes that tell what a file is."""
_VERSION_7_3 = b"MATLAB 7.3"
_SUBSYSTEM = slice(116, 124)
"""Bytes of the header of a MAT file of version 5 to 7 that say where objects begin; zeros or blanks where none are."""
_NS_OF_MS = 1_000_000
_FAR_MS = 9.2e12
"""Time (ms since 1970) beyond which nanoseconds do not fit 64 bits."""
_DEEPEST = 50
"""Number of structures and objects inside one another: what nests deeper is no recording."""


@dataclass
class Content:
    """What a file holds.

    Attributes
    ----------
    arrays : dict of str to ndarray
        Numbers and dates (datetime64[ns]); empty arrays of text for variables of another kind.
    objects : dict of str to str
        Class of each object that could not be made arrays.
    units : dict of str to str
        As a table states them.
    clocks : dict of str to str
        Times of its rows, for each variable of a timetable.
    """

    arrays: dict[str, NDArray[Any]] = field(default_factory=dict)
    objects: dict[str, str] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    clocks: dict[str, str] = field(default_factory=dict)


def is_newest(head: bytes) -> bool:
    """Whether the first `HEAD` bytes of a file are those of a MAT file of version 7.3, or of other HDF5."""
    return head[_HDF5_AT:].startswith(_HDF5) or head.startswith((_HDF5, _VERSION_7_3))


def has_objects(head: bytes) -> bool:
    """Whether the first `HEAD` bytes of a MAT file of version 5 to 7 announce objects."""
    return head.startswith(b"MATLAB") and head[_SUBSYSTEM].strip(b" \0") != b""


def read_objects(path: str) -> Content:
    """Read a file with objects, or one of version 7.3.

    Parameters
    ----------
    path : str
        Of a MAT file.
    """
    import h5py  # noqa: PLC0415 (with matio, which not everyone has installed)
    import matio  # noqa: PLC0415

    if h5py.is_hdf5(path):
        with h5py.File(path, "r") as file:
            _refuse_elsewhere(file)
    found = Content()
    for name, value in matio.load_from_mat(path, raw_data=True).items():
        if not name.startswith("__"):
            _add(found, name, value, 0)
    return found


def _refuse_elsewhere(group: Any) -> None:
    """Refuse HDF5 that takes data from other files: who sends a file must not name what is read here."""
    import h5py  # noqa: PLC0415

    waiting, seen = [group], set()
    while waiting:
        for name, one in _links(waiting.pop()):
            elsewhere = not isinstance(one, h5py.HardLink)
            thing = None if elsewhere else group[name]
            if isinstance(thing, h5py.Dataset):
                elsewhere = bool(thing.external) or thing.is_virtual
            if elsewhere:
                raise ValueError(f"{name.lstrip('/')} lies in another file or place")
            if isinstance(thing, h5py.Group) and thing.id not in seen:
                seen.add(thing.id)
                waiting.append(thing)


def _links(group: Any) -> list[tuple[str, Any]]:
    return [(f"{group.name.rstrip('/')}/{name}", group.get(name, getlink=True)) for name in group]


def _add(found: Content, name: str, value: Any, depth: int) -> None:
    """Take a variable apart: fields of structures and variables of tables are named ``struct.field``."""
    if depth > _DEEPEST:
        raise ValueError(f"{name[:40]}...: more than {_DEEPEST} structures inside one another")
    kind = getattr(value, "classname", None)
    if kind in _TABLES:
        _TABLES[kind](found, name, value.properties, depth)
    elif kind in _TIMES:
        found.arrays[name] = _plain(_TIMES[kind](value.properties))
    elif kind is not None:
        found.objects[name] = str(kind)
        found.arrays[name] = np.empty(0, "U1")
    elif getattr(value, "dtype", None) is not None and value.dtype.names and value.size == 1:
        for key in value.dtype.names:
            _add(found, f"{name}.{key}", value.reshape(-1)[0][key], depth + 1)
    else:
        found.arrays[name] = _plain(value)


def _plain(value: Any) -> NDArray[Any]:
    """Return numbers and dates without axes of length one; nothing of what is neither."""
    array = np.asarray(value)
    array = array.astype(np.uint8) if array.dtype.kind == "b" else array
    return array.squeeze() if array.dtype.kind in "iufM" else np.empty(0, "U1")


def _date(properties: Any) -> NDArray[Any]:
    """Moments (datetime64[ns]) of a datetime; the imaginary part is what the real part rounds off."""
    ms = np.asarray(properties["data"])
    good = (np.abs(ms.real) < _FAR_MS) & (np.abs(ms.imag) < 1.0)
    whole = np.floor(np.where(good, ms.real, 0.0))
    part = np.where(good, ms.real - whole + ms.imag, 0.0)
    ns = whole.astype(np.int64) * _NS_OF_MS + np.rint(part * _NS_OF_MS).astype(np.int64)
    out = ns.astype("datetime64[ns]")
    out[~good] = np.datetime64("NaT", "ns")
    return np.asarray(out)


def _seconds(properties: Any) -> NDArray[Any]:
    """Seconds of a duration."""
    return np.asarray(np.asarray(properties["millis"], np.float64) / 1000.0)


def _timetable(found: Content, name: str, properties: Any, depth: int) -> None:
    inside = properties["any"].reshape(-1)[0]
    names = _names(inside, "VarNames")
    clock = f"{name}.{_names(inside, 'DimNames')[0]}"
    found.arrays[clock] = _plain(_row_times(inside["rowTimes"], int(_one(inside["numRows"]))))
    for column in _variables(found, name, names, inside["data"], _texts(inside["varUnits"]), depth):
        found.clocks[column] = clock


def _table(found: Content, name: str, properties: Any, depth: int) -> None:
    units = _texts(properties["props"].reshape(-1)[0]["VariableUnits"])
    _variables(found, name, _texts(properties["varnames"]), properties["data"], units, depth)


def _variables(found: Content, name: str, names: list[str], data: Any, units: list[str], depth: int) -> list[str]:
    """Add the variables of a table; return their names, with that of the table."""
    cells = np.asarray(data, object).reshape(-1)
    if len(cells) != len(names):
        raise ValueError(f"{name}: {len(cells)} variables, and {len(names)} names")
    columns = [f"{name}.{one}" for one in names]
    for column, cell, unit in zip(columns, cells, [*units, *[""] * len(names)], strict=False):
        _add(found, column, cell, depth + 1)
        if unit:
            found.units[column] = unit
    return columns


def _names(inside: Any, kind: str) -> list[str]:
    """Names of variables or dimensions: since R2019b any text is one, and stands in a list of its own."""
    key = kind[0].lower() + kind[1:]
    for newer in ("2048", "Orig"):
        flag = f"use{kind}{newer}"
        if flag in inside.dtype.names and bool(_one(inside[flag])):
            return _texts(inside[key + newer])
    return _texts(inside[key])


def _row_times(times: Any, rows: int) -> NDArray[Any]:
    """Return dates, or seconds, of the rows; where they are even, MATLAB keeps their beginning and step, or rate."""
    if getattr(times, "classname", None) in _TIMES:
        return _TIMES[times.classname](times.properties)
    regular = times.reshape(-1)[0]
    begin = _TIMES[regular["origin"].classname](regular["origin"].properties).reshape(-1)[0]
    if bool(_one(regular["specifiedAsRate"])):
        step = 1.0 / float(_one(regular["sampleRate"]))
    else:
        step = float(_seconds(regular["stepSize"].properties).reshape(-1)[0])
    after = np.arange(rows) * step
    if isinstance(begin, np.datetime64):
        return np.asarray(begin + np.rint(after * 1e9).astype("timedelta64[ns]"))
    return np.asarray(begin + after)


def _one(value: Any) -> Any:
    return np.asarray(value).reshape(-1)[0]


def _texts(cells: Any) -> list[str]:
    """Texts of a list of MATLAB."""
    return ["".join(map(str, np.asarray(cell).reshape(-1))) for cell in np.asarray(cells).reshape(-1)]


_TIMES = {"datetime": _date, "duration": _seconds}
_TABLES = {"timetable": _timetable, "table": _table}
