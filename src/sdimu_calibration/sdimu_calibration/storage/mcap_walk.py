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
from mcap.data_stream import ReadDataStream
from mcap.records import Channel, Chunk, Header, Schema
from mcap.stream_reader import StreamReader, get_chunk_data_stream
from numpy.typing import NDArray

from sdimu_calibration.core.arrays import Ints
from sdimu_calibration.core.compiled import compiled

MAGIC = b"\x89MCAP0\r\n"

_HEAD = struct.Struct("<BQ")
_HEADER, _FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 1, 2, 3, 4, 5, 6
_LARGEST = 1 << 32
"""Bytes of a record beyond which its length is taken for damage."""


class DamagedError(Exception):
    """The file ends, or stops making sense, before its footer."""


@dataclass(frozen=True)
class Messages:
    """Messages of one chunk.

    Attributes
    ----------
    content : bytes
    channel, time_ns, start, length : ndarray of int, shape (n,)
        Channel and log time of each message; where its bytes begin in `content`, and how many they are.
    """

    content: bytes
    channel: Ints
    time_ns: Ints
    start: Ints
    length: Ints

    def __len__(self) -> int:
        """Return the number of messages."""
        return len(self.channel)

    def __iter__(self) -> Iterator[tuple[int, int, bytes]]:
        """Yield channel, log time (ns) and bytes of each message."""
        columns = (self.channel.tolist(), self.time_ns.tolist(), self.start.tolist(), self.length.tolist())
        for channel, time_ns, start, length in zip(*columns, strict=True):
            yield channel, time_ns, self.content[start : start + length]


@compiled
def _number(content: NDArray[np.uint8], start: int, size: int) -> int:
    """Little-endian number of `size` bytes."""
    value = 0
    for k in range(size):
        value |= int(content[start + k]) << (8 * k)
    return value


@compiled
def _records(content: NDArray[np.uint8], found: Ints) -> int:
    """Fill a row (kind, channel, time, start, length) of `found` for each record; return their number, -1 on damage.

    `start` and `length` are of the bytes of a message, of the whole record otherwise.
    """
    count, start, size = 0, 0, content.shape[0]
    while start < size:
        if start + 9 > size:
            return -1
        kind, length = content[start], _number(content, start + 1, 8)
        if length < 0 or length > size - start - 9:
            return -1
        found[count, 0] = kind
        found[count, 3] = start
        found[count, 4] = 9 + length
        if kind == _MESSAGE:
            if length < 22:
                return -1
            found[count, 1] = _number(content, start + 9, 2)
            found[count, 2] = _number(content, start + 15, 8)
            found[count, 3] = start + 31
            found[count, 4] = length - 22
        count += 1
        start += 9 + length
    return count


class McapWalk:
    """Walk over the messages of an MCAP file.

    Attributes
    ----------
    profile : str
        ``ros2`` for a recording of ROS 2.
    channels : dict of int to mcap.records.Channel
        Those met until now.
    schemas : dict of int to mcap.records.Schema
        Those met until now.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.profile = ""
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}

    def type_name(self, channel: int) -> str:
        """Type of the messages of a channel, such as ``sensor_msgs/msg/Imu``."""
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
        size = self.path.stat().st_size
        if stream.read(len(MAGIC)) != MAGIC:
            raise DamagedError("not an MCAP file")
        while True:
            head = stream.read(_HEAD.size)
            kind, length = _HEAD.unpack(head)
            if length > min(_LARGEST, size - stream.tell()):
                raise DamagedError("the file ends inside a record")
            if kind in {_HEADER, _SCHEMA, _CHANNEL}:
                self._register(head + stream.read(length))
            elif kind == _CHUNK:
                yield self._messages(Chunk.read(ReadDataStream(BytesIO(stream.read(length)))))
            elif kind == _MESSAGE:
                yield self._found(head + stream.read(length))
            elif kind == _FOOTER:
                stream.seek(length, SEEK_CUR)
                if stream.read(len(MAGIC)) != MAGIC:
                    raise DamagedError("the file ends without its magic")
                return
            else:
                stream.seek(length, SEEK_CUR)

    def _messages(self, chunk: Chunk) -> Messages:
        stream, size = get_chunk_data_stream(chunk)
        content = stream.read(size)
        if size != chunk.uncompressed_size or (chunk.uncompressed_crc not in {0, zlib.crc32(content)}):
            raise DamagedError("checksum of a chunk does not match")
        return self._found(content)

    def _found(self, content: bytes) -> Messages:
        """Find the messages among records; register schemas and channels."""
        rows = np.empty((len(content) // _HEAD.size + 1, 5), np.int64)
        count = _records(np.frombuffer(content, np.uint8), rows)
        if count < 0:
            raise DamagedError("a record is longer than its chunk")
        kind, channel, time_ns, start, length = rows[:count].T
        for k in np.flatnonzero((kind == _SCHEMA) | (kind == _CHANNEL)):
            self._register(content[start[k] : start[k] + length[k]])
        chosen = kind == _MESSAGE
        return Messages(content, channel[chosen], time_ns[chosen], start[chosen], length[chosen])

    def _register(self, record: bytes) -> None:
        reader = StreamReader(BytesIO(record), skip_magic=True)
        found = next(iter(reader.records))
        if isinstance(found, Schema):
            self.schemas[found.id] = found
        elif isinstance(found, Channel):
            self.channels[found.id] = found
        elif isinstance(found, Header):
            self.profile = found.profile
