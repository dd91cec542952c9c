"""Messages of one topic as they stand in the blocks of a bag: no copy of each, and fields of all of them at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, overload

import numpy as np
from numpy.typing import DTypeLike, NDArray

from sdimu_calibration.core.arrays import Ints


class Block:
    """Messages inside one buffer.

    Attributes
    ----------
    start, length : ndarray of int, shape (n,)
        First byte of each message, and number of its bytes.
    """

    def __init__(self, buffer: bytes, start: Ints, length: Ints) -> None:
        self.buffer = buffer
        self.start = start
        self.length = length

    def __iter__(self) -> Iterator[bytes]:
        """Yield the bytes of each message."""
        for start, length in zip(self.start.tolist(), self.length.tolist(), strict=True):
            yield self.buffer[start : start + length]

    def field(self, place: int | Ints, dtype: DTypeLike, count: int = 1) -> NDArray[Any]:
        """Take the same field of every message.

        Parameters
        ----------
        place : int or ndarray of int, shape (n,)
            Byte of the message at which the field begins; the field must end inside the message.
        count : int
            Neighbouring numbers.

        Returns
        -------
        ndarray, shape (n, count)
        """
        size = count * np.dtype(dtype).itemsize
        # Every byte of the buffer as the beginning of a field: numpy then copies whole fields.
        fields = np.ndarray((len(self.buffer) - size + 1,), f"V{size}", self.buffer, strides=(1,))
        return np.asarray(fields[self.start + place].view(dtype).reshape(-1, count))

    def alone(self) -> Block:
        """Return the same messages in a buffer of their own: this one keeps that of a whole chunk alive."""
        if (self.length == self.length[0]).all():
            content = self.field(0, np.uint8, int(self.length[0])).tobytes() if self.length[0] else b""
        else:
            content = b"".join(self)
        return Block(content, np.cumsum(self.length) - self.length, self.length)


class RawMessages(Sequence[bytes]):
    """Messages (CDR bytes) of one topic in the order of the bag."""

    def __init__(self, messages: Sequence[bytes] = ()) -> None:
        self._blocks: list[Block] = []
        self._loose: list[bytes] = list(messages)
        self._before: list[int] = []
        self._count = 0

    def append(self, message: bytes) -> None:
        """Append one message."""
        self._loose.append(message)

    def extend(self, block: Block) -> None:
        """Append the messages of a block."""
        self._close()
        if 2 * int(block.length.sum()) < len(block.buffer):
            block = block.alone()
        self._add(block)

    def ends(self) -> tuple[bytes, bytes]:
        """First and last message."""
        return self[0], self[-1]

    def blocks(self) -> list[Block]:
        """All messages, in order."""
        self._close()
        return self._blocks

    def __len__(self) -> int:
        """Return the number of messages."""
        return self._count + len(self._loose)

    def __iter__(self) -> Iterator[bytes]:
        """Yield the bytes of each message."""
        for block in self.blocks():
            yield from block

    @overload
    def __getitem__(self, place: int) -> bytes: ...
    @overload
    def __getitem__(self, place: slice) -> list[bytes]: ...
    def __getitem__(self, place: int | slice) -> bytes | list[bytes]:
        """Return the bytes of one message, or of several."""
        if isinstance(place, slice):
            return [self[k] for k in range(*place.indices(len(self)))]
        blocks = self.blocks()
        k = range(self._count)[place]
        number = int(np.searchsorted(self._before, k, side="right")) - 1
        block, k = blocks[number], k - self._before[number]
        start = int(block.start[k])
        return block.buffer[start : start + int(block.length[k])]

    def _close(self) -> None:
        """Make a block of the messages that were appended one by one."""
        if self._loose:
            length = np.fromiter(map(len, self._loose), np.int64, len(self._loose))
            self._add(Block(b"".join(self._loose), np.cumsum(length) - length, length))
            self._loose = []

    def _add(self, block: Block) -> None:
        if len(block.start):
            self._before.append(self._count)
            self._blocks.append(block)
            self._count += len(block.start)
