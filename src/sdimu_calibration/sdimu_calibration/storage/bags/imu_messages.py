"""Messages of an IMU decoded as they are read, so that a long recording needs the memory of its numbers only."""

from __future__ import annotations

import mmap
from collections.abc import Callable, Sequence
from tempfile import TemporaryFile, gettempdir
from typing import Any

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags.cdr import LayoutError, decode_imu_block
from sdimu_calibration.storage.bags.frames import Frames
from sdimu_calibration.storage.bags.raw_messages import Block, RawMessages

Samples = tuple[Ints, Floats, Floats]
"""Stamps (n,) (ns), rates (n, 3) (rad/s), specific forces (n, 3) (m/s^2)."""
_IN_MEMORY = 1 << 21
"""Number of samples from which they lie in a file: a hundred megabytes, three hours at 200 Hz."""
_LOOSE = 4096
"""Messages that are decoded at once where they come one by one."""


class SampleFile:
    """Takes samples block by block and gives them back as arrays that the system may leave on the disk."""

    def __init__(self) -> None:
        self._files = [TemporaryFile(prefix="sdimu-") for _ in range(3)]  # noqa: SIM115 (they last as long as the arrays)
        self._count = 0

    def append(self, blocks: Sequence[Samples]) -> None:
        """Append blocks of samples."""
        try:
            for block in blocks:
                for file, column in zip(self._files, block, strict=True):
                    file.write(np.ascontiguousarray(column).data)
                self._count += len(block[0])
        except OSError as error:
            raise DataError(
                f"{gettempdir()}: no room for the samples of a long recording ({error.strerror or error}); set "
                "the environment variable TMPDIR to a folder with room for 60 bytes a sample"
            ) from error

    def samples(self) -> Samples:
        """Return all samples; the files go with the arrays."""
        for file in self._files:
            file.flush()
        ns, omega, force = (
            self._mapped(file, dtype) for file, dtype in zip(self._files, (np.int64, float, float), strict=True)
        )
        return ns, omega.reshape(-1, 3), force.reshape(-1, 3)

    def _mapped(self, file: Any, dtype: type) -> Any:
        return np.frombuffer(mmap.mmap(file.fileno(), 0), dtype)


class ImuMessages(RawMessages):
    """Messages of an IMU that are decoded as they are read: 56 bytes of each are kept, not 350.

    They can be counted and decoded, not gone through. Blocks that have no layout in common are kept as they are, for
    a reader that takes messages one by one.
    """

    def __init__(self) -> None:
        super().__init__()
        self._decoded: list[Samples | Block] = []
        self._file: SampleFile | None = None
        self._waiting = 0
        self._number = 0
        self._ends: list[bytes] = []
        self._frames = Frames()
        self.left_out = ""
        """What is no part of the samples, once they were asked for: messages of another `frame_id`."""

    def append(self, message: bytes) -> None:
        """Append one message."""
        super().append(message)
        if len(self._loose) >= _LOOSE:
            self._close()

    def __len__(self) -> int:
        """Return the number of messages."""
        return self._number + len(self._loose)

    def ends(self) -> tuple[bytes, bytes]:
        """First and last message."""
        self._close()
        return self._ends[0], self._ends[-1]

    def samples(self, one_by_one: Callable[[Sequence[bytes]], Samples]) -> Samples:
        """Return stamps (n,) (ns), rates (n, 3) (rad/s) and specific forces (n, 3) (m/s^2) of the main `frame_id`.

        Parameters
        ----------
        one_by_one : callable
            Reads the messages of blocks that have no layout in common.
        """
        self._close()
        ns, omega, force = self._all(one_by_one)
        chosen = self._frames.chosen()
        if chosen is None:
            return ns, omega, force
        kept, self.left_out = chosen
        return ns[kept], omega[kept], force[kept]

    def _all(self, one_by_one: Callable[[Sequence[bytes]], Samples]) -> Samples:
        found = [one_by_one(list(part)) if isinstance(part, Block) else part for part in self._decoded]
        self._decoded = []
        if self._file is not None:
            self._file.append(found)
            return self._file.samples()
        ns, omega, force = zip(*found, strict=True) if found else ((), (), ())
        empty = np.empty((0, 3))
        return (
            np.concatenate([np.empty(0, np.int64), *ns]),
            np.concatenate([empty, *omega]),
            np.concatenate([empty, *force]),
        )

    def _add(self, block: Block) -> None:
        if not len(block.start):
            return
        first, last = (block.buffer[block.start[k] : block.start[k] + block.length[k]] for k in (0, -1))
        self._ends = [self._ends[0] if self._ends else first, last]
        self._number += len(block.start)
        self._frames.add(block)
        try:
            self._decoded.append(decode_imu_block(block))
        except LayoutError:
            self._decoded.append(block)
        self._waiting += len(block.start)
        if self._waiting >= _IN_MEMORY:
            self._put_away()

    def _put_away(self) -> None:
        """Write what was decoded to a file, up to the first block that waits for a reader of single messages."""
        count = next((k for k, part in enumerate(self._decoded) if isinstance(part, Block)), len(self._decoded))
        known, self._decoded = self._decoded[:count], self._decoded[count:]
        self._file = self._file or SampleFile()
        self._file.append([part for part in known if not isinstance(part, Block)])
        self._waiting = 0
