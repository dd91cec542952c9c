"""RAWIMU logs of NovAtel receivers in ASCII, long (``#RAWIMUA``) and short (``%RAWIMUSA``), as lines of a table.

After the header come week and seconds of GPS time, the status of the IMU, then increments in counts: accelerometers Z,
-Y, X, gyros Z, -Y, X. Source: OEM7 Commands and Logs Reference Manual, RAWIMU and RAWIMUS. The size of a count is that
of the IMU (table "Raw IMU Scale Factors" there).
"""

from __future__ import annotations

import re
from collections.abc import Sequence

HEADINGS = (
    "week", "seconds", "status", "accel_z", "-accel_y", "accel_x", "gyro_z", "-gyro_y", "gyro_x", "gps",
)  # fmt: skip
"""Names of the columns: those of the log, and `gps`, seconds of GPS time since its beginning on 1980-01-06."""
_LOG = re.compile(r"[#%]RAWIMUS?A,[^;]*;(\d+),(\d+)(\.\d+)?,([0-9a-fA-F]+)((?:,-?\d+){6})\*[0-9a-fA-F]{8}\s*")
_WEEK_S = 604_800
"""Length of a GPS week (s): definition."""


def is_novatel(lines: Sequence[str]) -> bool:
    """Whether some of the first lines are RAWIMU logs."""
    return any(_LOG.fullmatch(line) for line in lines[:100])


def as_table(lines: Sequence[str]) -> list[str]:
    """Return the logs as lines of numbers in the order of `HEADINGS`; other lines come out empty: numbers stay."""
    return [_row(line) for line in lines]


def _row(line: str) -> str:
    match = _LOG.fullmatch(line)
    if match is None:
        return ""
    week, second, fraction, status, counts = match.groups()
    gps = int(week) * _WEEK_S + int(second)
    return f"{week},{second}{fraction or ''},{int(status, 16)}{counts},{gps}{fraction or ''}"
