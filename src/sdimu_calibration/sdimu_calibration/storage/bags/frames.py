"""Which messages of a topic are of one IMU: those of the `frame_id` that most of them have.

Two publishers on one topic, or a stray message, mix the readings of two sensors into one row of samples.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from sdimu_calibration.core.arrays import Bools, Ints
from sdimu_calibration.core.plain_text import counted, one_line
from sdimu_calibration.storage.bags.raw_messages import Block, RawMessages

_TEXT = 16
"""First byte of the text of frame_id in a message whose header comes first (CDR)."""
_SHOWN, _LONGEST_NAME = 3, 60
"""Names that are told at most, and characters of each."""
_ANY = -1
"""In the place of a frame where a message has no such layout: it is read otherwise, and kept."""


class Frames:
    """Counts the messages of each `frame_id` as they are read."""

    def __init__(self) -> None:
        self._names: dict[bytes, int] = {}
        self._parts: list[tuple[int, int | Ints]] = []

    def add(self, block: Block) -> None:
        """Take the next messages."""
        self._parts.append((len(block.start), self._of(block)))

    def main(self) -> bytes | None:
        """Return the frame of most messages, the earlier one of two with as many; None before any."""
        counts = self._counts()
        return max(counts, key=lambda name: counts[name]) if counts else None

    def has(self, name: bytes) -> bool:
        """Whether a message is of a frame."""
        return name in self._names

    def chosen(self, name: bytes | None = None) -> tuple[Bools, str] | None:
        """Say which messages are of a frame, by default of most, and what is left out.

        A frame that begins after the last message of that one, or ends before the first, is the same IMU renamed: its
        messages are kept.

        Returns
        -------
        (ndarray of bool, str), shape (n,), or None
            None where all are kept.
        """
        name = self.main() if name is None else name
        if name is None or set(self._names) <= {name}:
            return None
        ids = np.concatenate([np.broadcast_to(np.asarray(ids), (count,)) for count, ids in self._parts])
        rows = np.flatnonzero(ids == self._names.get(name, _ANY - 1))
        left = {}
        for other, number in self._names.items():
            at = np.flatnonzero(ids == number)
            if other != name and not (len(rows) and len(at) and (at[0] > rows[-1] or at[-1] < rows[0])):
                left[other] = at
        kept = np.ones(len(ids), dtype=bool)
        for at in left.values():
            kept[at] = False
        return (kept, self._words(name, len(rows), left)) if left else None

    @staticmethod
    def _words(name: bytes, taken: int, left: dict[bytes, Ints]) -> str:
        listed = [f"{len(at)} of {_shown(other)}" for other, at in list(left.items())[:_SHOWN]]
        more = f" and {len(left) - _SHOWN} more" if len(left) > _SHOWN else ""
        number = counted(sum(map(len, left.values())), "message is", "messages are")
        return (
            f"{number} of another frame_id and left out ({', '.join(listed)}{more}; {taken} of {_shown(name)} are "
            "taken): give each publisher a topic of its own"
        )

    def _counts(self) -> dict[bytes, int]:
        counts = np.zeros(len(self._names), dtype=np.int64)
        for count, ids in self._parts:
            if not isinstance(ids, int):
                counts += np.bincount(ids[ids != _ANY], minlength=len(counts))
            elif ids != _ANY:
                counts[ids] += count
        return {name: int(counts[number]) for name, number in self._names.items()}

    def _of(self, block: Block) -> int | Ints:
        """Return the number of the frame of all messages of a block, or of each."""
        if not len(block.start) or block.length.min() <= _TEXT or (block.field(1, np.uint8) != 1).any():
            return _ANY
        size = block.field(_TEXT - 4, "<u4")[:, 0].astype(np.int64)
        if (size == size[0]).all() and 0 < size[0] <= block.length.min() - _TEXT:
            text = block.field(_TEXT, np.uint8, int(size[0]))
            if (text == text[0]).all():
                return self._number(text[0].tobytes())
        ends = np.minimum(_TEXT + size, block.length)
        return np.array(
            [
                self._number(block.buffer[start + _TEXT : start + end])
                for start, end in zip(block.start.tolist(), ends.tolist(), strict=True)
            ],
            dtype=np.int64,
        )

    def _number(self, text: bytes) -> int:
        return self._names.setdefault(text.rstrip(b"\0"), len(self._names))


def frames_of(messages: Iterable[bytes]) -> Frames:
    """Count the frames of some messages."""
    frames = Frames()
    for block in RawMessages(list(messages)).blocks():
        frames.add(block)
    return frames


def _shown(name: bytes) -> str:
    return f"'{one_line(name.decode(errors='replace'), _LONGEST_NAME)}'"
