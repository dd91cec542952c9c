"""A file as text, in the encodings of loggers and spreadsheets; what is no text is named, with what reads it."""

from __future__ import annotations

import codecs
from pathlib import Path

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.bounded_file import read_bounded

LONGEST_TABLE = 1 << 32
"""Bytes of a table of numbers at most: in memory its lines take three times as much. Several files are one import."""
_BAG = "it needs no import: sdimu calibrate BAG reads it"
_PACKED = "unpack it, and import what is in it"
_KINDS = (
    (b"#ROSBAG V", f"is a bag of ROS 1 (.bag): {_BAG}"),
    (b"SQLite format 3\x00", f"is a data base; if it is a bag of ROS 2 (.db3), {_BAG}"),
    (b"\x89MCAP0\r\n", f"is a bag of ROS 2 (.mcap): {_BAG}"),
    (b"ULog\x01\x12\x35", "is a log of PX4 (ULog): turn it into CSV (ulog2csv), and import that"),
    (b"MATLAB", "is a MAT file: let its name end in .mat, and name its variables in a map (--map)"),
    (b"\x89HDF\r\n\x1a\n", "is an HDF5 file: write its numbers as CSV, MAT (-v7) or NPZ"),
    (b"PK\x03\x04", f"is a spreadsheet (.xlsx) or another ZIP: save the sheet as CSV; else {_PACKED}"),
    (b"\xd0\xcf\x11\xe0", "is a spreadsheet (.xls): save the sheet as CSV"),
    (b"\x1f\x8b", f"is packed (gzip): {_PACKED}"),
    (b"\x28\xb5\x2f\xfd", f"is packed (zstd): {_PACKED}"),
    (b"BZh", f"is packed (bzip2): {_PACKED}"),
)
"""First bytes of files that are no table in text, what they are, and what to do."""
_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_LOOKED_AT = 4096
"""Number of bytes by which UTF-16 without a mark is told."""
_SPACES = frozenset("\t\n\r\v\f")


def read_text(path: Path) -> tuple[str, tuple[str, ...]]:
    """Read a file of text.

    Returns
    -------
    text : str
    notes : tuple of str
        Which encoding was taken, where the file does not say it.

    Raises
    ------
    DataError
        The file is no text; the error says what it is, as far as its first bytes tell.
    """
    content = read_bounded(path, LONGEST_TABLE)
    for first, what in _KINDS:
        if content.startswith(first):
            raise DataError(f"{path}: {what}")
    wide = _utf16(content)
    if wide is not None:
        return wide, ()
    try:
        return content.decode("utf-8-sig"), ()
    except UnicodeDecodeError as error:
        text = content.decode("latin-1")
        if _is_plain(text):
            return text, (f"{path}: is not in UTF-8 and was read as Latin-1: look at letters beyond a to z",)
        raise DataError(
            f"{path}: is not text (expected CSV in UTF-8, MAT or NPZ); for bare numbers state their "
            "type and number in the map, such as binary: {type: float64, columns: 7}"
        ) from error


def _utf16(content: bytes) -> str | None:
    """Decode two bytes a character, with a mark or where every other byte is zero; None for anything else."""
    head = content[: _LOOKED_AT - _LOOKED_AT % 2]
    zeros = 2 * head[1::2].count(0), 2 * head[::2].count(0)
    if content.startswith(_UTF16):
        name = "utf-16"
    elif max(zeros) > 0.9 * len(head) > 0.0:
        name = "utf-16-le" if zeros[0] > zeros[1] else "utf-16-be"
    else:
        return None
    try:
        text = content.decode(name)
    except UnicodeDecodeError:
        return None
    return text if _is_plain(text) else None


def _is_plain(text: str) -> bool:
    """Whether there are no control characters but those that part lines and columns."""
    found = set(text)
    return not any((ord(c) < 0x20 or 0x7F <= ord(c) < 0xA0) and c not in _SPACES for c in found)
