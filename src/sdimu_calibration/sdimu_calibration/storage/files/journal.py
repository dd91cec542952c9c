"""What a live calibration has taken, written before it is acknowledged: a killed node goes on from here.

One append-only file: a line of JSON (format, digest of the options), then records of a kind (one byte), a length, a
checksum (four bytes each) and their content. A kill leaves at most the last record cut; reading goes as far as records
are whole, and cuts off the rest. What one ``write`` has handed to the system survives the death of the process, so
nothing needs to wait for the disk.

The journal is also where the samples of a running test are: a day at 200 Hz is a gigabyte, which no memory need hold
before the end asks for it (`Journal.raw`).
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import shutil
import struct
import tempfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import FileIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.data.arrival import RawTest
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.journal_walk import Counts, raw_test, walk
from sdimu_calibration.storage.files.whole_file import free_beside

Stamps = Ints

JOURNAL = "calibration.journal"
FORMAT = "sdimu-journal/2"
_HEAD = struct.Struct("<cII")
_STATUS = struct.Struct("<qqq")
_TEMPERATURE = struct.Struct("<qd")
_COLUMNS = 7
"""Doubles a sample: the stamp's bits, three rates, three forces."""
_READ = 1 << 20
"""Bytes that are read at once."""
_KINDS = (b"I", b"S", b"T")
"""Kinds of records: samples, status, temperature."""
_LONGEST_TORN = 1 << 16
"""Bytes of a record that a kill can have cut off, at most: a node writes no more than a thousand samples at once."""
_LONGEST_HEADER = 1000
"""Bytes within which the line at the head ends."""


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
    options : str
        Digest of the options that the data are used with.
    lasting : bool
        False for a file beside `path` that has no name: it ends with the process, and nobody goes on with it.

    Attributes
    ----------
    before : Counts
        What it held when it was opened.
    cut_bytes : int
        Bytes behind the last whole record of a predecessor, which are gone.
    set_aside : Path or None
        Where the file now is that was in this place and is of other options, or its copy where records of it are
        damaged and others stand behind them.
    why_aside : str
        Why it was set aside.
    """

    def __init__(self, path: Path, options: str, *, lasting: bool = True) -> None:
        self._path = path
        self._lasting = lasting
        self._header = json.dumps({"format": FORMAT, "options": options}).encode() + b"\n"
        self.why_aside = "was of other options than this node's, which begins anew"
        self.set_aside: Path | None = None
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = self._opened()
            if lasting and (aside := self._put_aside()):
                self.set_aside = aside
                self._file.close()
                self._file = self._opened()
        except OSError as error:
            raise DataError(
                f"{path}: the journal of the test cannot be written here ({error.strerror}); name another folder by "
                "'out'"
            ) from error
        self.before, self.cut_bytes = Counts(0, 0, 0), 0
        self._before_end = len(self._header)
        self._recall()

    def _opened(self) -> FileIO:
        """Open the file unbuffered: a record is with the system when the call returns."""
        if not self._lasting:
            return tempfile.TemporaryFile("a+b", buffering=0, dir=self._path.parent)
        if self._path.exists() and not self._path.is_file():
            raise DataError(
                f"{self._path}: this is no file, and the journal must be here; move it, or name another folder by 'out'"
            )
        file = self._path.open("a+b", buffering=0)
        try:
            fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            # Records of two nodes would be one test.
            file.close()
            raise DataError(
                f"{self._path}: another calibration node that lives writes it; end it, or name another folder by 'out'"
            ) from error
        except OSError:
            # A file system without locks.
            return file
        return file

    def _put_aside(self) -> Path | None:
        """Rename what is of other options, to the first number that is free: it may be all that there is of a test."""
        head = os.pread(self._file.fileno(), len(self._header) + 1, 0)
        if len(head) <= len(self._header) or head.startswith(self._header):
            return None
        return self._path.rename(free_beside(self._path))

    def _recall(self) -> None:
        """Count what is there and cut off a torn end; a file that holds no records is begun."""
        if os.pread(self._file.fileno(), len(self._header), 0) != self._header:
            self.restart()
            return
        content = self._content()
        self._before_end, self.before = walk(content, len(self._header))
        self.cut_bytes = len(content) - self._before_end
        if self._lasting and not _torn(bytes(content[self._before_end : self._before_end + _LONGEST_TORN])):
            self.set_aside = self.copy_aside()
            self.why_aside = f"is damaged after {self._before_end} bytes, and this node goes on from there"
        del content
        self._file.truncate(self._before_end)

    def _content(self) -> NDArray[np.uint8]:
        return np.asarray(np.memmap(self._file, np.uint8, "r"))

    def records(self, *, everything: bool = False) -> Iterator[Record]:
        """Give what the journal held when it was opened, record by record; `everything` is also what came since.

        What is written between two records of everything comes, too.
        """
        at, size = len(self._header), _READ
        while at < (end := os.fstat(self._file.fileno()).st_size if everything else self._before_end):
            block = os.pread(self._file.fileno(), min(size, end - at), at)
            place = 0
            while place + _HEAD.size <= len(block):
                kind, length, _ = _HEAD.unpack_from(block, place)
                end = place + _HEAD.size + length
                if end > len(block):
                    break
                yield _decoded(kind, block[place + _HEAD.size : end])
                place = end
            at += place
            size = _READ if place else _HEAD.size + length

    @property
    def place(self) -> Path:
        """Where another process reads it (`read_journal`), even where it has no name."""
        return Path(f"/proc/{os.getpid()}/fd/{self._file.fileno()}")

    def raw(self) -> RawTest:
        """Everything that is in it, in the order of arrival."""
        return raw_test(self._content(), len(self._header))

    def _append(self, kind: bytes, content: bytes) -> None:
        record = _HEAD.pack(kind, len(content), zlib.crc32(kind + content)) + content
        if self._file.write(record) != len(record):
            raise OSError(f"{self._path}: the disk is full; make room, or name another folder by 'out'")

    def samples(self, ns: Stamps, omega_ib_b: Floats, f_ib_b: Floats) -> None:
        """Keep samples."""
        self._append(b"I", np.column_stack([ns.view(np.float64), omega_ib_b, f_ib_b]).tobytes())

    def status(self, ns: int, dwell: bool, stop: int) -> None:
        """Keep a status."""
        self._append(b"S", _STATUS.pack(ns, int(dwell), stop))

    def temperature(self, ns: int, value: float) -> None:
        """Keep a temperature."""
        self._append(b"T", _TEMPERATURE.pack(ns, value))

    def copy_aside(self) -> Path:
        """Copy all of it to the first number beside it that is free: it is of a test that nothing else has."""
        aside = free_beside(self._path)
        shutil.copyfile(self._path, aside)
        return aside

    def restart(self) -> None:
        """Forget everything."""
        self._file.seek(0)
        self._file.truncate()
        self._file.write(self._header)
        self.before, self._before_end = Counts(0, 0, 0), len(self._header)

    def remove(self) -> None:
        """End it: the test is over."""
        self._file.close()
        if self._lasting:
            self._path.unlink(missing_ok=True)

    def close(self) -> None:
        """Leave it for a successor."""
        # A program that is being started meanwhile has the file for a moment, and with it the lock.
        if not self._file.closed:
            fcntl.flock(self._file.fileno(), fcntl.LOCK_UN)
        self._file.close()


def read_journal(path: Path) -> RawTest:
    """Read what another process has written so far, in the order of arrival."""
    try:
        content = np.fromfile(path, np.uint8)
    except OSError as error:
        raise DataError(f"{path}: the journal cannot be read ({error.strerror})") from error
    (ends,) = np.nonzero(content[:_LONGEST_HEADER] == ord("\n"))
    if not len(ends):
        raise DataError(f"{path}: no journal of a calibration")
    return raw_test(content, int(ends[0]) + 1)


def _torn(rest: bytes) -> bool:
    """Whether bytes behind the last whole record are the begin of one that a kill cut off, and no damaged ones."""
    if len(rest) < _HEAD.size:
        return True
    kind, length, _ = _HEAD.unpack_from(rest)
    return kind in _KINDS and len(rest) < min(_HEAD.size + length, _LONGEST_TORN)


def _decoded(kind: bytes, content: bytes) -> Record:
    if kind == b"S":
        ns, dwell, stop = _STATUS.unpack(content)
        return Status(ns, bool(dwell), stop)
    if kind == b"T":
        return Temperature(*_TEMPERATURE.unpack(content))
    rows = np.frombuffer(content).reshape(-1, _COLUMNS)
    return Samples(np.ascontiguousarray(rows[:, 0]).view(np.int64), rows[:, 1:4].copy(), rows[:, 4:].copy())
