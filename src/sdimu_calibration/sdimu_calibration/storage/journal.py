"""What a live calibration has taken, written before it is acknowledged: a killed node goes on from here.

One append-only file: a line of JSON (format, digest of the options), then records of a kind (one byte), a length, a
checksum (four bytes each) and their content. A kill leaves at most the last record cut; reading goes as far as records
are whole, and cuts off the rest. What one ``write`` has handed to the system survives the death of the process, so
nothing needs to wait for the disk.
"""

from __future__ import annotations

import hashlib
import json
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints

Stamps = Ints

FORMAT = "sdimu-journal/2"
_HEAD = struct.Struct("<cII")
_STATUS = struct.Struct("<qqq")
_TEMPERATURE = struct.Struct("<qd")
_COLUMNS = 7
"""Doubles a sample: the stamp's bits, three rates, three forces."""


@dataclass(frozen=True)
class Samples:
    """Samples as they arrived: stamps (n,) ns, rates and forces (n, 3)."""

    ns: Stamps
    omega_ib_b: Floats
    f_ib_b: Floats


@dataclass(frozen=True)
class Status:
    """A status that holds from a stamp (ns) on."""

    ns: int
    dwell: bool
    stop: int


@dataclass(frozen=True)
class Temperature:
    """A temperature (deg C) at a stamp (ns)."""

    ns: int
    value: float


Record = Samples | Status | Temperature


def digest(*options: object) -> str:
    """Digest of options; a journal of other options is not gone on with."""
    return hashlib.sha256(repr(options).encode()).hexdigest()[:16]


class Journal:
    """Appends records; made anew, or gone on with.

    Parameters
    ----------
    path : Path
    options : str
        Digest of the options that the data are used with.

    Attributes
    ----------
    before : tuple of Record
        What a predecessor left.
    cut_bytes : int
        Bytes behind the last whole record of it, which are gone.
    """

    def __init__(self, path: Path, options: str) -> None:
        self._path = path
        self._header = json.dumps({"format": FORMAT, "options": options}).encode() + b"\n"
        path.parent.mkdir(parents=True, exist_ok=True)
        self.cut_bytes = 0
        self.before = tuple(self._recall())
        # Unbuffered: a record is with the system when the call returns.
        self._file = path.open("ab", buffering=0)
        if not self._file.tell():
            self._file.write(self._header)

    def _recall(self) -> Iterator[Record]:
        """Read what is there and cut off a torn end; a file of other options is emptied."""
        content = self._path.read_bytes() if self._path.is_file() else b""
        at = len(self._header)
        if not content.startswith(self._header):
            self._path.unlink(missing_ok=True)
            return
        while at + _HEAD.size <= len(content):
            kind, length, checksum = _HEAD.unpack_from(content, at)
            end = at + _HEAD.size + length
            record = content[at + _HEAD.size : end]
            if end > len(content) or zlib.crc32(kind + record) != checksum:
                break
            yield _decoded(kind, record)
            at = end
        self.cut_bytes = len(content) - at
        with self._path.open("r+b") as file:
            file.truncate(at)

    def _append(self, kind: bytes, content: bytes) -> None:
        self._file.write(_HEAD.pack(kind, len(content), zlib.crc32(kind + content)) + content)

    def samples(self, ns: Stamps, omega_ib_b: Floats, f_ib_b: Floats) -> None:
        """Keep samples."""
        self._append(b"I", np.column_stack([ns.view(np.float64), omega_ib_b, f_ib_b]).tobytes())

    def status(self, ns: int, dwell: bool, stop: int) -> None:
        """Keep a status."""
        self._append(b"S", _STATUS.pack(ns, int(dwell), stop))

    def temperature(self, ns: int, value: float) -> None:
        """Keep a temperature."""
        self._append(b"T", _TEMPERATURE.pack(ns, value))

    def restart(self) -> None:
        """Forget everything."""
        self._file.truncate(0)
        self._file.write(self._header)
        self.before = ()

    def remove(self) -> None:
        """End it: the test is over."""
        self._file.close()
        self._path.unlink(missing_ok=True)

    def close(self) -> None:
        """Leave it for a successor."""
        self._file.close()


def _decoded(kind: bytes, content: bytes) -> Record:
    if kind == b"S":
        ns, dwell, stop = _STATUS.unpack(content)
        return Status(ns, bool(dwell), stop)
    if kind == b"T":
        return Temperature(*_TEMPERATURE.unpack(content))
    rows = np.frombuffer(content).reshape(-1, _COLUMNS)
    return Samples(np.ascontiguousarray(rows[:, 0]).view(np.int64), rows[:, 1:4].copy(), rows[:, 4:].copy())
