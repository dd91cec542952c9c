"""An MCAP file being written, message by message.

The writer of the mcap package spends 4 us a message on one record object each, more than everything else in
writing a bag; this one packs messages directly and leaves the rare records to the package. Format: the MCAP
specification, version 0.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping, Sequence
from itertools import chain
from typing import BinaryIO

import numpy as np
import zstandard
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from sdimu_calibration.core.arrays import Ints

_MESSAGE = struct.Struct("<BQHIQQ")
_MESSAGE_HEAD = 22
_HEADS = np.dtype(
    [("code", "u1"), ("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4"), ("log", "<u8"), ("publish", "<u8")]
)
"""`_MESSAGE` as rows of an array."""
_CHUNK_BYTES = 1 << 20


class McapFile:
    """Writer of zstd chunks with message indices, summary and footer.

    Parameters
    ----------
    stream : binary file
        Open for writing, at its start; it stays open when the file is finished.
    """

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._position = self._checksum = 0
        self._schemas: list[records.Schema] = []
        self._channels: list[records.Channel] = []
        self._counts: list[int] = []
        self._chunks: list[records.ChunkIndex] = []
        self.first_ns, self.last_ns = 0, 0
        self._start_chunk()
        self._put(MCAP0_MAGIC + _record(records.Header(profile="ros2", library="sdimu-calibration")))

    def schema(self, name: str, text: bytes, encoding: str = "ros2msg") -> int:
        """Register a message type with its definition; return its id."""
        schema = records.Schema(id=len(self._schemas) + 1, data=text, encoding=encoding, name=name)
        self._schemas.append(schema)
        self._add(_record(schema))
        return len(self._schemas)

    def channel(self, topic: str, schema: int, metadata: Mapping[str, str]) -> int:
        """Register a topic of CDR messages; return its id."""
        channel = records.Channel(
            id=len(self._channels) + 1, topic=topic, message_encoding="cdr", metadata=dict(metadata), schema_id=schema
        )
        self._channels.append(channel)
        self._counts.append(0)
        self._add(_record(channel))
        return len(self._channels)

    def message(self, channel: int, data: bytes, time_ns: int) -> None:
        """Append a message under its time (ns)."""
        sequence = self._counts[channel - 1]
        self._counts[channel - 1] = sequence + 1
        self._index.append((channel, time_ns, self._size))
        self._add(_MESSAGE.pack(Opcode.MESSAGE, _MESSAGE_HEAD + len(data), channel, sequence, time_ns, time_ns) + data)
        if self._size > _CHUNK_BYTES:
            self._close_chunk()

    def messages(self, channel: Ints, data: Sequence[bytes], time_ns: Ints) -> None:
        """Append many messages: the same file as by `message`, without work for each.

        Parameters
        ----------
        channel : ndarray of int, shape (n,)
        data : sequence of bytes, length n
        time_ns : ndarray of int, shape (n,)
            Times (ns).
        """
        size = np.fromiter(map(len, data), np.int64, len(data))
        heads = np.zeros(len(data), _HEADS)
        heads["code"], heads["length"] = int(Opcode.MESSAGE), _MESSAGE_HEAD + size
        heads["channel"], heads["log"], heads["publish"] = channel, time_ns, time_ns
        for number in np.unique(channel).tolist():
            own = np.flatnonzero(channel == number)
            heads["sequence"][own] = self._counts[number - 1] + np.arange(len(own))
            self._counts[number - 1] += len(own)
        records_of = heads.view(f"V{_HEADS.itemsize}").tolist()
        end = np.cumsum(size + _HEADS.itemsize)
        first = 0
        while first < len(data):
            # The message that passes the size of a chunk is the last one in it.
            before = int(end[first - 1]) if first else 0
            last = min(int(np.searchsorted(end, _CHUNK_BYTES - self._size + before, side="right")) + 1, len(data))
            rows = slice(first, last)
            place = self._size - before + end[rows] - size[rows] - _HEADS.itemsize
            self._index += zip(channel[rows].tolist(), time_ns[rows].tolist(), place.tolist(), strict=True)
            self._parts += chain.from_iterable(zip(records_of[rows], data[rows], strict=True))
            self._size += int(end[last - 1]) - before
            if self._size > _CHUNK_BYTES:
                self._close_chunk()
            first = last

    def flush(self) -> None:
        """Close the chunk and hand it to the system."""
        self._close_chunk()
        self._stream.flush()

    def finish(self) -> None:
        """Write summary and footer."""
        self._close_chunk()
        self._put(_record(records.DataEnd(data_section_crc=self._checksum)))
        summary_start = self._position
        groups = [self._schemas, self._channels, [self._statistics()], self._chunks]
        summary, offsets = b"", b""
        for group in groups:
            block = b"".join(map(_record, group))
            if block:
                offset = records.SummaryOffset(
                    group_opcode=Opcode(block[0]), group_start=summary_start + len(summary), group_length=len(block)
                )
                offsets += _record(offset)
            summary += block
        offset_start = summary_start + len(summary)
        summary += offsets
        head = struct.pack("<BQQQ", Opcode.FOOTER, 20, summary_start, offset_start)
        crc = zlib.crc32(head, zlib.crc32(summary))
        self._put(summary + head + struct.pack("<I", crc) + MCAP0_MAGIC)
        self._stream.flush()

    def _start_chunk(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0
        self._index: list[tuple[int, int, int]] = []

    def _add(self, record: bytes) -> None:
        self._parts.append(record)
        self._size += len(record)

    def _put(self, data: bytes) -> None:
        self._stream.write(data)
        self._position += len(data)
        self._checksum = zlib.crc32(data, self._checksum)

    def _close_chunk(self) -> None:
        """Write the chunk in progress and its message indices; schemas alone wait for a message."""
        if not self._index:
            return
        index = np.array(self._index, np.uint64)
        first, last = int(index[:, 1].min()), int(index[:, 1].max())
        self.first_ns = first if not self._chunks else min(first, self.first_ns)
        self.last_ns = max(last, self.last_ns)
        content = b"".join(self._parts)
        packed = zstandard.compress(content)
        chunk = _record(
            records.Chunk(
                compression="zstd",
                data=packed,
                message_start_time=first,
                message_end_time=last,
                uncompressed_crc=zlib.crc32(content),
                uncompressed_size=len(content),
            )
        )
        start = self._position
        self._put(chunk)
        offsets = {}
        for channel in np.unique(index[:, 0]):
            offsets[int(channel)] = self._position
            entries = index[index[:, 0] == channel, 1:].astype("<u8").tobytes()
            self._put(struct.pack("<BQHI", Opcode.MESSAGE_INDEX, 6 + len(entries), channel, len(entries)) + entries)
        self._chunks.append(
            records.ChunkIndex(
                chunk_length=len(chunk),
                chunk_start_offset=start,
                compression="zstd",
                compressed_size=len(packed),
                message_end_time=last,
                message_index_length=self._position - start - len(chunk),
                message_index_offsets=offsets,
                message_start_time=first,
                uncompressed_size=len(content),
            )
        )
        self._start_chunk()

    def _statistics(self) -> records.Statistics:
        return records.Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts={i + 1: count for i, count in enumerate(self._counts)},
            chunk_count=len(self._chunks),
            message_count=sum(self._counts),
            metadata_count=0,
            message_start_time=self.first_ns,
            message_end_time=self.last_ns,
            schema_count=len(self._schemas),
        )


def _record(record: records.McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())
