"""Samples that a program holds in arrays or in a data frame, as what the topics of a test brought."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.data.arrival import RawStatus, RawTemperature, RawTest
from sdimu_calibration.core.recording import DataError

ARRAYS = "arrays"
"""What a recording of arrays is called where another has the name of its file."""
_TRIADS = {triad: [f"{triad}_{axis}" for axis in "xyz"] for triad in ("gyro", "accel")}
_KNOWN = ("t", "ns", *_TRIADS, *(name for names in _TRIADS.values() for name in names), "temperature", "dwell", "stop")
_NS = 1_000_000_000
_LONGEST_S = 4e9
"""Time (s) beyond which a column is no time in seconds: a century and more."""


def raw_test(samples: Mapping[str, Any]) -> RawTest:
    """Take the arrays of a test.

    Parameters
    ----------
    samples : mapping of str to array, or DataFrame
        ``t`` (s) or ``ns`` (integers), shape (n,): end of the interval of each sample. ``gyro`` and ``accel``, shape
        (n, 3), or their columns ``gyro_x`` ... ``accel_z``: body rate and specific force, mean over the interval.
        Optional: ``temperature`` (deg C), and ``dwell`` (true at rest) with ``stop`` (integers), shape (n,).

    Returns
    -------
    RawTest
    """
    if not hasattr(samples, "keys"):
        raise DataError(
            f"{ARRAYS}: {type(samples).__name__} has no columns by name; give t, gyro and accel in a mapping"
        )
    given = {str(name): np.asarray(samples[name]) for name in samples}
    for name in given:
        if name not in _KNOWN:
            near = get_close_matches(name, _KNOWN, n=1)
            hint = f"did you mean {near[0]}?" if near else f"expected some of {', '.join(_KNOWN)}"
            raise DataError(f"{ARRAYS}: no column is called '{name}'; {hint}")
    ns = _stamps(given)
    omega, force = (_triad(given, triad, len(ns)) for triad in _TRIADS)
    status, temperature = _status(given, ns), None
    if "temperature" in given:
        temperature = RawTemperature(ns, _column(given, "temperature", len(ns)))
    return RawTest(ns, omega, force, status, temperature, where=ARRAYS)


def _stamps(given: Mapping[str, Any]) -> Ints:
    if "ns" in given:
        if given["ns"].dtype.kind not in "iu" or given["ns"].ndim != 1:
            raise DataError(f"{ARRAYS}: ns holds no integers of shape (n,): give seconds as t")
        return np.asarray(given["ns"], dtype=np.int64)
    if "t" not in given:
        raise DataError(f"{ARRAYS}: no time: give t (s) or ns (integers)")
    t = _column(given, "t", len(given["t"]) if given["t"].ndim else 0)
    if not np.isfinite(t).all() or np.abs(t).max(initial=0.0) > _LONGEST_S:
        count = int(np.count_nonzero(~np.isfinite(t)))
        raise DataError(
            f"{ARRAYS}: {count} values of t are no numbers"
            if count
            else f"{ARRAYS}: t is no time in seconds: stamps in ns are given as ns"
        )
    return np.asarray(np.rint(t * _NS), dtype=np.int64)


def _triad(given: Mapping[str, Any], triad: str, n: int) -> Floats:
    columns = _TRIADS[triad]
    if triad in given:
        values = _numbers(given[triad], triad)
    elif all(name in given for name in columns):
        values = np.column_stack([_numbers(given[name], name) for name in columns])
    else:
        lack = ", ".join(name for name in columns if name not in given)
        raise DataError(f"{ARRAYS}: no {triad}: give {triad}, shape (n, 3), or {lack}")
    if values.shape != (n, 3):
        raise DataError(f"{ARRAYS}: {triad} has shape {values.shape}, expected ({n}, 3) as the time has")
    return values


def _column(given: Mapping[str, Any], name: str, n: int) -> Floats:
    values = _numbers(given[name], name)
    if not n:
        raise DataError(f"{ARRAYS}: {name} holds no samples")
    if values.shape != (n,):
        raise DataError(f"{ARRAYS}: {name} has shape {values.shape}, expected ({n},) as the time has")
    return values


def _numbers(values: Any, name: str) -> Floats:
    # numpy would drop the imaginary part with no more than a warning.
    if np.iscomplexobj(values):
        raise DataError(f"{ARRAYS}: {name} holds complex numbers; give real ones, such as {name}.real")
    try:
        return np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise DataError(f"{ARRAYS}: {name} holds no numbers") from None


def _status(given: Mapping[str, Any], ns: Ints) -> RawStatus | None:
    """Take rest and stop where they change; None where rests are to be found."""
    if "dwell" not in given:
        if "stop" in given:
            raise DataError(f"{ARRAYS}: stop without dwell: give dwell (true at rest) too")
        return None
    dwell = _column(given, "dwell", len(ns)) != 0.0
    counted = np.cumsum(np.concatenate([[0], (dwell[1:] & ~dwell[:-1]).astype(np.int64)]))
    stop = _column(given, "stop", len(ns)).astype(np.int64) if "stop" in given else counted
    changes = np.flatnonzero(np.concatenate([[True], (np.diff(dwell.astype(int)) != 0) | (np.diff(stop) != 0)]))
    # Once a second too: what was said holds for a while only.
    beats = np.flatnonzero(np.diff(ns // _NS, prepend=-1) != 0)
    rows = np.union1d(changes, beats)
    return RawStatus(ns[rows], dwell[rows], stop[rows])
