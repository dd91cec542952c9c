"""An MCAP file read from front to back, as far as it is whole.

Needs neither index nor footer, so it serves both for reading and for mending: order is by stamp, later, and not by
arrival. Records that no reader here asks for, such as message indices, are passed over.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import SEEK_CUR, BytesIO
from pathlib import Path
from typing import BinaryIO

import numpy as np
from mcap.records import Channel, Header, Schema
from mcap.stream_reader import StreamReader
from numpy.typing import NDArray

from sdimu_calibration.core.arrays import Ints
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.storage.bags.unpacking import Allowance, allowed

MAGIC = b"\x89MCAP0\r\n"

_HEAD = struct.Struct("<BQ")
_CHUNK_HEAD = struct.Struct("<QQQII")
_HEADER, _FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 1, 2, 3, 4, 5, 6
_STATISTICS, _DATA_END = 11, 15
_PIECE = 1 << 20


class DamagedError(Exception):
    """The file ends, or stops making sense, before its footer."""


@dataclass(frozen=True)
class Messages:
    """Messages of one chunk."""

    content: bytes
    channel: Ints
    time_ns: Ints
    start: Ints
    length: Ints
    """`channel`, `time_ns`, `start`, `length`: shape (n,). Channel and log time of each message; where its bytes begin
    in `content`, and how many they are."""

    def __len__(self) -> int:
        """Return the number of messages."""
        return len(self.channel)

    def __iter__(self) -> Iterator[tuple[int, int, bytes]]:
        """Yield channel, log time (ns) and bytes of each message."""
        columns = (self.channel.tolist(), self.time_ns.tolist(), self.start.tolist(), self.length.tolist())
        for channel, time_ns, start, length in zip(*columns, strict=True):
            yield channel, time_ns, self.content[start : start + length]

    def channels(self) -> list[int]:
        """Channels that have a message, ascending."""
        # Numbers of two bytes: counting them is ten times as fast as sorting.
        return np.flatnonzero(np.bincount(self.channel)).tolist()


@compiled
def _number(content: NDArray[np.uint8], start: int, size: int) -> int:
    """Little-endian number of `size` bytes."""
    value = 0
    for k in range(size):
        value |= int(content[start + k]) << (8 * k)
    return value


@compiled
def _records(content: NDArray[np.uint8], found: Ints) -> int:
    """Fill a row (kind, channel, time, start, length) of `found` for each message, schema and channel.

    `start` and `length` are of the bytes of a message, of the whole record otherwise. Without rows they are counted.
    Returns their number, -1 on damage.
    """
    count, start, size = 0, 0, content.shape[0]
    while start < size:
        if start + 9 > size:
            return -1
        kind, length = content[start], _number(content, start + 1, 8)
        if length < 0 or length > size - start - 9 or (kind == _MESSAGE and length < 22):
            return -1
        if kind in (_MESSAGE, _SCHEMA, _CHANNEL):
            if count < found.shape[0]:
                found[count, 0] = kind
                found[count, 3] = start
                found[count, 4] = 9 + length
                if kind == _MESSAGE:
                    found[count, 1] = _number(content, start + 9, 2)
                    found[count, 2] = _number(content, start + 15, 8)
                    found[count, 3] = start + 31
                    found[count, 4] = length - 22
            count += 1
        start += 9 + length
    return count


class _Source:
    """A file read from front to back, with a checksum of what has passed since it was last asked for."""

    def __init__(self, stream: BinaryIO, size: int) -> None:
        self._stream = stream
        self._size = size
        self.checksum = 0
        self.sound = True

    def read(self, count: int) -> bytes:
        """Read `count` bytes."""
        if count > self._size - self._stream.tell():
            raise DamagedError("the file ends inside a record")
        data = self._stream.read(count)
        self.checksum = zlib.crc32(data, self.checksum)
        return data

    def skip(self, count: int) -> None:
        """Pass over `count` bytes."""
        while count:
            count -= len(self.read(min(count, _PIECE)))

    def back(self, count: int) -> None:
        """Take `count` bytes back: the checksum is lost."""
        self._stream.seek(-count, SEEK_CUR)
        self.sound = False

    def check(self, expected: int, what: str) -> None:
        """Raise DamagedError unless the checksum is as the file says; zero says nothing. Begin a new one."""
        if expected and self.sound and expected != self.checksum:
            raise DamagedError(f"checksum of the {what} does not match")
        self.checksum = 0


class McapWalk:
    """Walk over the messages of an MCAP file, once.

    Parameters
    ----------
    most : int, optional
        Bytes that its chunks may unpack to; by the size of the file when left out.

    Attributes
    ----------
    profile : str
        ``ros2`` for a recording of ROS 2.
    channels : dict of int to mcap.records.Channel
        Those met until now.
    schemas : dict of int to mcap.records.Schema
        Those met until now.
    """

    def __init__(self, path: Path, most: int | None = None) -> None:
        self.path = path
        self.profile = ""
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}
        self._expected: int | None = None
        self._allowance = Allowance(allowed(path) if most is None else most)

    def type_name(self, channel: int) -> str:
        """Type of the messages of a channel, such as ``sensor_msgs/msg/Imu``; empty where nothing says it."""
        schema = self.schemas.get(self.channels[channel].schema_id)
        return str(schema.name) if schema is not None else ""

    def blocks(self) -> Iterator[Messages]:
        """Yield messages chunk by chunk, in the order of the file.

        Raises
        ------
        DamagedError
            When the file ends before its footer; what was yielded until then is whole.
        """
        with self.path.open("rb") as stream:
            try:
                yield from self._blocks(stream)
            except Exception as error:
                # The decoders below answer damage with whatever they stumble over first: struct.error,
                # EndOfFile, ZstdError, UnicodeDecodeError, MemoryError.
                raise DamagedError(str(error) or type(error).__name__) from error

    def _blocks(self, stream: BinaryIO) -> Iterator[Messages]:
        source = _Source(stream, self.path.stat().st_size)
        count, damage = 0, ""
        if source.read(len(MAGIC)) != MAGIC:
            raise DamagedError("not an MCAP file")
        kind = 0
        while kind != _FOOTER:
            before = source.checksum
            head = source.read(_HEAD.size)
            kind, length = _HEAD.unpack(head)
            if kind in {_CHUNK, _MESSAGE}:
                record = source.read(length)
                content, beyond = self._unpacked(record) if kind == _CHUNK else (head + record, 0)
                if beyond:
                    # What a wrong length took in are records of their own.
                    source.back(beyond)
                    damage = damage or "a chunk is shorter than its record says"
                block = self._found(content)
                count += len(block)
                yield block
            elif kind in {_HEADER, _SCHEMA, _CHANNEL}:
                self._register(head + source.read(length))
            else:
                self._close(source, kind, length, before)
        if self._expected is not None and self._expected != count:
            damage = damage or f"{count} messages are in the file, its statistics say {self._expected}"
        if damage:
            raise DamagedError(damage)

    def _close(self, source: _Source, kind: int, length: int, before: int) -> None:
        """Take in a record behind the messages; `before` is the checksum up to its head."""
        if kind == _STATISTICS:
            (self._expected,) = struct.unpack_from("<Q", source.read(length))
        elif kind == _DATA_END:
            (checksum,) = struct.unpack_from("<I", source.read(length))
            source.checksum = before
            source.check(checksum, "data")
        elif kind == _FOOTER:
            source.read(16)
            before = source.checksum
            (checksum,) = struct.unpack_from("<I", source.read(length - 16))
            source.checksum = before
            source.check(checksum, "summary")
            if source.read(len(MAGIC)) != MAGIC:
                raise DamagedError("the file ends without its magic")
        else:
            source.skip(length)

    def _unpacked(self, record: bytes) -> tuple[bytes, int]:
        """Return the records of a chunk, and how many bytes of its own record lie beyond it."""
        _, _, size, checksum, name_length = _CHUNK_HEAD.unpack_from(record)
        at = _CHUNK_HEAD.size + name_length
        compression = record[_CHUNK_HEAD.size : at].decode()
        (length,) = struct.unpack_from("<Q", record, at)
        beyond = len(record) - at - 8 - length
        if beyond < 0:
            raise DamagedError("a chunk is longer than its record")
        content = self._allowance.unpack(compression, record[at + 8 : at + 8 + length], size)
        if size != len(content) or checksum not in {0, zlib.crc32(content)}:
            raise DamagedError("checksum of a chunk does not match")
        return content, beyond

    def _found(self, content: bytes) -> Messages:
        """Find the messages among records; register schemas and channels."""
        data = np.frombuffer(content, np.uint8)
        count = _records(data, np.empty((0, 5), np.int64))
        if count < 0:
            raise DamagedError("a record is longer than its chunk")
        rows = np.empty((count, 5), np.int64)
        _records(data, rows)
        kind, channel, time_ns, start, length = rows.T
        for k in np.flatnonzero(kind != _MESSAGE):
            self._register(content[start[k] : start[k] + length[k]])
        chosen = kind == _MESSAGE
        found = Messages(content, channel[chosen], time_ns[chosen], start[chosen], length[chosen])
        if not self.channels.keys() >= set(found.channels()):
            raise DamagedError("a message is of a channel that nothing describes")
        if (found.time_ns < 0).any():
            raise DamagedError("a message was logged after the year 2262")
        return found

    def _register(self, record: bytes) -> None:
        reader = StreamReader(BytesIO(record), skip_magic=True)
        found = next(iter(reader.records))
        if isinstance(found, Schema):
            self.schemas[found.id] = found
        elif isinstance(found, Channel):
            self.channels[found.id] = found
        elif isinstance(found, Header):
            self.profile = found.profile
