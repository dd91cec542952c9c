"""Bulk coding of the messages of a test between CDR bytes and arrays.

A message whose strings and array lengths stay the same has the same layout every time: then n messages
are n rows of one structured array, and no loop over messages is needed. CDR is little-endian XCDR version 1
(OMG DDS-XTypes 7.4), as ROS 2 writes it: 4 bytes of encapsulation, then fields aligned to their own size,
counted from the end of the encapsulation.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags.raw_messages import Block, RawMessages

Stamps = Ints
Rows = NDArray[np.uint8]

IMU = "sensor_msgs/msg/Imu"
JOINT_STATE = "sensor_msgs/msg/JointState"
STATUS = "diagnostic_msgs/msg/DiagnosticArray"
TEMPERATURE = "sensor_msgs/msg/Temperature"

_ENCAPSULATION = b"\x00\x01\x00\x00"
WITH_STAMP = 12
"""Bytes of a message that has a stamp, at least."""
# Places among the 37 doubles of an Imu message: orientation 4, covariance 9, rate 3, covariance 9, force 3, ...
_IMU_DOUBLES, _RATE, _FORCE = 37, slice(13, 16), slice(25, 28)


class LayoutError(ValueError):
    """Messages that do not share a layout; they must be decoded one by one."""


class Layout:
    """The layout of one message with its constant parts filled in, grown field by field."""

    def __init__(self, frame_id: str) -> None:
        self._template = bytearray(_ENCAPSULATION)
        self._padding: list[int] = []
        self._fields: dict[str, tuple[Any, int]] = {}
        self._number("sec", np.dtype("<i4"))
        self._number("nanosec", np.dtype("<u4"))
        self.string(frame_id)

    def string(self, text: str) -> Layout:
        """Append a constant string."""
        data = text.encode() + b"\x00"
        self.count(len(data))
        self._template += data
        return self

    def count(self, value: int) -> Layout:
        """Append a constant uint32, such as the length of a sequence."""
        self._align(4)
        self._template += value.to_bytes(4, "little")
        return self

    def byte(self, value: int) -> Layout:
        """Append a constant byte."""
        self._template.append(value)
        return self

    def doubles(self, name: str, number: int) -> Layout:
        """Append `number` doubles that are set row by row under `name`."""
        if number:
            self._number(name, np.dtype(("<f8", (number,))))
        return self

    def rows(self, stamp_ns: Stamps) -> NDArray[Any]:
        """Messages with these stamps and zeros in all doubles: structured array, shape (n,)."""
        names = list(self._fields)
        dtype = np.dtype(
            {
                "names": names,
                "formats": [self._fields[n][0] for n in names],
                "offsets": [self._fields[n][1] for n in names],
                "itemsize": len(self._template),
            }
        )
        one = np.frombuffer(bytes(self._template), np.uint8)
        messages = np.tile(one, (len(stamp_ns), 1)).reshape(-1).view(dtype)
        messages["sec"], messages["nanosec"] = np.divmod(stamp_ns, 1_000_000_000)
        return messages

    def offset(self, name: str) -> int:
        """Place of the field `name` in the message (bytes)."""
        return self._fields[name][1]

    @property
    def padding(self) -> list[int]:
        """Places of the bytes between fields; serializers leave in them whatever was there."""
        return self._padding

    def _align(self, size: int) -> None:
        missing = -(len(self._template) - 4) % size
        self._padding += range(len(self._template), len(self._template) + missing)
        self._template += bytes(missing)

    def _number(self, name: str, dtype: np.dtype[Any]) -> None:
        self._align(dtype.base.itemsize)
        self._fields[name] = (dtype, len(self._template))
        self._template += bytes(dtype.itemsize)


def as_bytes(messages: NDArray[Any]) -> list[bytes]:
    """Cut a structured array of messages into the bytes of each."""
    return list(messages.view(f"V{messages.dtype.itemsize}").tolist())


def stamp_of(message: bytes) -> int:
    """Stamp (ns) of the header with which a message begins, in the byte order that it names.

    Raises
    ------
    LayoutError
        When the message ends before its stamp does.
    """
    if len(message) < WITH_STAMP:
        raise LayoutError("message too short")
    order = _order(message)
    sec = int.from_bytes(message[4:8], order, signed=True)
    return sec * 1_000_000_000 + int.from_bytes(message[8:12], order)


def by_stamp(raw: Sequence[bytes], topic: str) -> tuple[Stamps, list[bytes]]:
    """Sort messages by the stamps of their headers.

    Parameters
    ----------
    raw : sequence of bytes, length n
    topic : str
        For the message to the user.

    Returns
    -------
    stamp_ns : ndarray, shape (n,)
        Ascending (ns).
    messages : list of bytes, length n
    """
    messages = list(raw)
    if any(len(message) < WITH_STAMP for message in messages):
        number = 1 + next(k for k, message in enumerate(messages) if len(message) < WITH_STAMP)
        raise DataError(f"{topic}: message {number} has no stamp: the bag is damaged")
    ns = np.fromiter(map(stamp_of, messages), np.int64, len(messages))
    order = np.argsort(ns, kind="stable")
    return ns[order], [messages[k] for k in order.tolist()]


def stamped(message: bytes, stamp_ns: int) -> bytes:
    """Return the message with another stamp (ns) in its header."""
    order = _order(message)
    sec, nanosec = divmod(stamp_ns, 1_000_000_000)
    return message[:4] + sec.to_bytes(4, order, signed=True) + nanosec.to_bytes(4, order) + message[12:]


def _order(message: bytes) -> Literal["little", "big"]:
    return "little" if message[1] & 1 else "big"


def encode_imu(
    stamp_ns: Stamps,
    omega_ib_b: Floats,
    f_ib_b: Floats,
    frame_id: str = "imu_link",
    covariances: tuple[Floats, Floats] | None = None,
) -> list[bytes]:
    """Encode sensor_msgs/Imu without an orientation.

    Parameters
    ----------
    stamp_ns : ndarray, shape (n,)
        Stamps (ns).
    omega_ib_b, f_ib_b : ndarray, shape (n, 3)
        Rate (rad/s) and specific force (m/s^2), in the frame of the IMU.
    covariances : (ndarray, ndarray), each of shape (n, 3, 3), optional
        Of rate and force; zero, which is not known, when left out.

    Returns
    -------
    list of bytes, length n
    """
    messages = Layout(frame_id).doubles("values", _IMU_DOUBLES).rows(stamp_ns)
    values = messages["values"]
    values[:, 3] = 1.0
    values[:, 4] = -1.0  # "no orientation", by the definition of the message
    values[:, _RATE], values[:, _FORCE] = omega_ib_b, f_ib_b
    for place, covariance in zip((_RATE, _FORCE), covariances or (), strict=False):
        values[:, place.stop : place.stop + 9] = covariance.reshape(-1, 9)
    return as_bytes(messages)


def encode_temperature(stamp_ns: Stamps, value_degc: Floats, frame_id: str = "imu_link") -> list[bytes]:
    """Encode sensor_msgs/Temperature: `stamp_ns` (n,) ns, `value_degc` (n,) deg C; list of n messages."""
    messages = Layout(frame_id).doubles("values", 2).rows(stamp_ns)
    messages["values"][:, 0] = value_degc
    return as_bytes(messages)


def encode_joint_states(
    stamp_ns: Stamps, names: tuple[str, ...], position: Floats, velocity: Floats, frame_id: str = "rate_table"
) -> list[bytes]:
    """Encode sensor_msgs/JointState without efforts.

    Parameters
    ----------
    stamp_ns : ndarray, shape (n,)
        Stamps (ns).
    names : tuple of str, length k
    position, velocity : ndarray, shape (n, k)
        Angles (rad) and rates (rad/s).

    Returns
    -------
    list of bytes, length n
    """
    layout = Layout(frame_id).count(len(names))
    for name in names:
        layout.string(name)
    layout.count(len(names)).doubles("position", len(names))
    layout.count(len(names)).doubles("velocity", len(names)).count(0)
    messages = layout.rows(stamp_ns)
    messages["position"] = position
    messages["velocity"] = velocity
    return as_bytes(messages)


def encode_status(stamp_ns: Stamps, dwell: Bools, stop: Ints, frame_id: str = "rate_table") -> list[bytes]:
    """Encode the table's status as diagnostic_msgs/DiagnosticArray, shapes (n,); list of n messages."""
    encoded = np.empty(len(stamp_ns), dtype=object)
    kinds = np.stack([np.asarray(dwell, np.int64), np.asarray(stop, np.int64)], axis=1)
    for is_dwell, index in np.unique(kinds, axis=0):
        phase = "dwell" if is_dwell else "rotating"
        layout = Layout(frame_id).count(1).byte(0).string("rate_table").string(phase).string("rate_table")
        layout.count(2).string("phase").string(phase).string("stop").string(str(index))
        chosen = np.flatnonzero((kinds == (is_dwell, index)).all(axis=1))
        encoded[chosen] = as_bytes(layout.rows(np.asarray(stamp_ns)[chosen]))
    return list(encoded)


def decode_imu(raw: Sequence[bytes]) -> tuple[Stamps, Floats, Floats]:
    """Decode sensor_msgs/Imu.

    Parameters
    ----------
    raw : sequence of bytes, length n

    Returns
    -------
    stamp_ns : ndarray, shape (n,)
    omega_ib_b, f_ib_b : ndarray, shape (n, 3)
        Rate (rad/s) and specific force (m/s^2).

    Raises
    ------
    LayoutError
        When the bytes are not what a constant layout says.
    """
    stamp_ns, (omega, force) = _decode_parts(raw, _IMU_DOUBLES, (_RATE, _FORCE))
    return stamp_ns, omega, force


def decode_doubles(raw: Sequence[bytes], number: int) -> tuple[Stamps, Floats]:
    """Decode messages made of a header and `number` doubles, whatever the length of frame_id.

    Parameters
    ----------
    raw : sequence of bytes, length n

    Returns
    -------
    stamp_ns : ndarray, shape (n,)
    values : ndarray, shape (n, number)

    Raises
    ------
    LayoutError
        When a message is not made so.
    """
    stamp_ns, (values,) = _decode_parts(raw, number, (slice(0, number),))
    return stamp_ns, values


def _decode_parts(raw: Sequence[bytes], number: int, parts: Sequence[slice]) -> tuple[Stamps, list[Floats]]:
    """Decode stamps (n,) and some of the doubles: one array (n, k) for each of `parts`."""
    messages = raw if isinstance(raw, RawMessages) else RawMessages(raw)
    found = [_decode_block(block, number, parts) for block in messages.blocks()]
    empty = [np.empty((0, part.stop - part.start)) for part in parts]
    values = zip(empty, *(columns for _, columns in found), strict=True)
    return np.concatenate([np.empty(0, np.int64), *(ns for ns, _ in found)]), [np.concatenate(v) for v in values]


def decode_imu_block(block: Block) -> tuple[Stamps, Floats, Floats]:
    """Decode the sensor_msgs/Imu of one block; as `decode_imu`."""
    stamp_ns, (omega, force) = _decode_block(block, _IMU_DOUBLES, (_RATE, _FORCE))
    return stamp_ns, omega, force


def _decode_block(block: Block, number: int, parts: Sequence[slice]) -> tuple[Stamps, list[Floats]]:
    """Decode the messages of one block, as `_decode_parts`."""
    start = block.length - 8 * number
    if (start < WITH_STAMP + 4).any():
        raise LayoutError("message too short")
    text = 12 + block.field(12, "<u4")[:, 0].astype(np.int64)
    if (block.field(1, np.uint8) != 1).any() or (4 + text + -text % 8 != start).any():
        raise LayoutError("other layout")
    second, nanosecond = block.field(4, "<i4")[:, 0], block.field(8, "<u4")[:, 0]
    columns = [block.field(start + 8 * part.start, "<f8", part.stop - part.start) for part in parts]
    return second.astype(np.int64) * 1_000_000_000 + nanosecond, columns


class _Cursor:
    """Reads one message from front to back, from behind the stamp of its header."""

    def __init__(self, message: bytes) -> None:
        if len(message) < WITH_STAMP:
            raise LayoutError("message too short")
        self._message, self._order = message, _order(message)
        self._place = WITH_STAMP
        self.string()  # frame_id

    def skip(self, size: int) -> bytes:
        """Pass over `size` bytes and return them."""
        self._place += size
        if self._place > len(self._message):
            raise LayoutError("message too short")
        return self._message[self._place - size : self._place]

    def count(self) -> int:
        """Read a uint32, such as the length of a sequence."""
        self.skip(-(self._place - 4) % 4)
        return int.from_bytes(self.skip(4), self._order)

    def string(self) -> str:
        """Read a string."""
        return self.skip(self.count()).rstrip(b"\x00").decode(errors="replace")

    def doubles(self) -> Floats:
        """Read a sequence of doubles, shape (n,)."""
        number = self.count()
        if number:
            self.skip(-(self._place - 4) % 8)
        return np.frombuffer(self.skip(8 * number), "<f8" if self._order == "little" else ">f8").astype(np.float64)


def decode_status(message: bytes) -> tuple[str, dict[str, str]]:
    """Decode text and values of the first entry of a diagnostic_msgs/DiagnosticArray; nothing when there is none.

    Raises
    ------
    LayoutError
        When the message ends before the entry does.
    """
    cursor = _Cursor(message)
    if not cursor.count():
        return "", {}
    cursor.skip(1)  # level
    _, text, _ = cursor.string(), cursor.string(), cursor.string()
    return text, {cursor.string(): cursor.string() for _ in range(cursor.count())}


def decode_joint_state(message: bytes) -> tuple[tuple[str, ...], Floats]:
    """Decode names (length k) and angles (rad), shape (k,), of a sensor_msgs/JointState.

    Raises
    ------
    LayoutError
        When the message ends before they do.
    """
    cursor = _Cursor(message)
    return tuple(cursor.string() for _ in range(cursor.count())), cursor.doubles()


def decode_stamps(rows: Rows) -> Stamps:
    """Stamps (ns), shape (n,), of messages that begin with a header: `rows` (n, length) bytes."""
    second = rows[:, 4:8].copy().view("<i4")[:, 0].astype(np.int64)
    return second * 1_000_000_000 + rows[:, 8:12].copy().view("<u4")[:, 0].astype(np.int64)


def decode_joint_positions(raw: Sequence[bytes], names: tuple[str, ...], first: Floats) -> tuple[Stamps, Floats]:
    """Decode the angles of sensor_msgs/JointState that all name the same axes.

    Parameters
    ----------
    raw : sequence of bytes, length n
    names : tuple of str, length k
        As in the first message.
    first : ndarray, shape (k,)
        Angles (rad) in the first message, by which the layout is checked.

    Returns
    -------
    stamp_ns : ndarray, shape (n,)
    position : ndarray, shape (n, k)
        Angles (rad).

    Raises
    ------
    LayoutError
        When not all messages share a layout with one position an axis.
    """
    messages = raw if isinstance(raw, RawMessages) else RawMessages(raw)
    size = np.unique(np.concatenate([block.length for block in messages.blocks()]))
    if len(size) != 1 or not names:
        raise LayoutError("lengths differ, or there are no axes")
    rows = np.concatenate([block.field(0, np.uint8, int(size[0])) for block in messages.blocks()])
    frame_id_length = int(rows[0, 12:16].copy().view("<u4")[0]) - 1
    if not 0 <= frame_id_length < rows.shape[1]:
        raise LayoutError("other layout")
    layout = Layout("-" * frame_id_length).count(len(names))
    for name in names:
        layout.string(name)
    offset = layout.count(len(names)).doubles("position", len(names)).offset("position")
    end = offset + 8 * len(names)
    fixed = np.setdiff1d(np.arange(12, offset), layout.padding)
    if end > rows.shape[1] or (rows[:, 1] != 1).any() or (rows[:, fixed] != rows[0, fixed]).any():
        raise LayoutError("layouts differ")
    position = rows[:, offset:end].copy().view("<f8")
    if not np.array_equal(position[0], first, equal_nan=True):
        raise LayoutError("other layout")
    return decode_stamps(rows), position
