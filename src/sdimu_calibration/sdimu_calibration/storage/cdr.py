"""Bulk coding of the messages of a test between CDR bytes and arrays.

A message whose strings and array lengths stay the same has the same layout every time: then n messages
are n rows of one structured array, and no loop over messages is needed. CDR is little-endian XCDR version 1
(OMG DDS-XTypes 7.4), as ROS 2 writes it: 4 bytes of encapsulation, then fields aligned to their own size,
counted from the end of the encapsulation.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from sdimu_calibration.core.arrays import Bools, Floats, Ints

Stamps = Ints
Rows = NDArray[np.uint8]

IMU = "sensor_msgs/msg/Imu"
JOINT_STATE = "sensor_msgs/msg/JointState"
STATUS = "diagnostic_msgs/msg/DiagnosticArray"
TEMPERATURE = "sensor_msgs/msg/Temperature"

_ENCAPSULATION = b"\x00\x01\x00\x00"
_STAMP_END = 12
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
    """Stamp (ns) of the header with which a message begins, in the byte order that it names."""
    order = _order(message)
    sec = int.from_bytes(message[4:8], order, signed=True)
    return sec * 1_000_000_000 + int.from_bytes(message[8:12], order)


def stamped(message: bytes, stamp_ns: int) -> bytes:
    """Return the message with another stamp (ns) in its header."""
    order = _order(message)
    sec, nanosec = divmod(stamp_ns, 1_000_000_000)
    return message[:4] + sec.to_bytes(4, order, signed=True) + nanosec.to_bytes(4, order) + message[12:]


def _order(message: bytes) -> Literal["little", "big"]:
    return "little" if message[1] & 1 else "big"


def encode_imu(stamp_ns: Stamps, omega_ib_b: Floats, f_ib_b: Floats, frame_id: str = "imu_link") -> list[bytes]:
    """Encode sensor_msgs/Imu without an orientation.

    Parameters
    ----------
    stamp_ns : ndarray, shape (n,)
        Stamps (ns).
    omega_ib_b, f_ib_b : ndarray, shape (n, 3)
        Rate (rad/s) and specific force (m/s^2), in the frame of the IMU.
    frame_id : str

    Returns
    -------
    list of bytes, length n
    """
    messages = Layout(frame_id).doubles("values", _IMU_DOUBLES).rows(stamp_ns)
    messages["values"][:, 3] = 1.0
    messages["values"][:, 4] = -1.0  # "no orientation", by the definition of the message
    messages["values"][:, _RATE] = omega_ib_b
    messages["values"][:, _FORCE] = f_ib_b
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
    frame_id : str

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


def encode_status(
    stamp_ns: Stamps, dwell: Bools, stop: Ints, frame_id: str = "rate_table"
) -> list[bytes]:
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


def decode_imu(raw: list[bytes]) -> tuple[Stamps, Floats, Floats]:
    """Decode sensor_msgs/Imu.

    Parameters
    ----------
    raw : list of bytes, length n

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
    stamp_ns, values = decode_doubles(raw, _IMU_DOUBLES)
    return stamp_ns, values[:, _RATE].copy(), values[:, _FORCE].copy()


def decode_doubles(raw: list[bytes], number: int) -> tuple[Stamps, Floats]:
    """Decode messages made of a header and `number` doubles, whatever the length of frame_id.

    Parameters
    ----------
    raw : list of bytes, length n
    number : int

    Returns
    -------
    stamp_ns : ndarray, shape (n,)
    values : ndarray, shape (n, number)

    Raises
    ------
    LayoutError
        When a message is not made so.
    """
    stamp_ns = np.empty(len(raw), np.int64)
    values = np.empty((len(raw), number))
    lengths = np.fromiter(map(len, raw), np.int64, len(raw))
    for length in np.unique(lengths):
        chosen = np.flatnonzero(lengths == length)
        same = raw if len(chosen) == len(raw) else [raw[i] for i in chosen]
        start = int(length) - 8 * number
        if start < _STAMP_END + 4:
            raise LayoutError("message too short")
        messages = np.frombuffer(b"".join(same), _stamped(start, number, int(length)))
        text = 12 + messages["text"].astype(np.int64)
        if (messages["order"] != 1).any() or (4 + text + -text % 8 != start).any():
            raise LayoutError("other layout")
        stamp_ns[chosen] = messages["sec"] * np.int64(1_000_000_000) + messages["nanosec"]
        values[chosen] = messages["values"]
    return stamp_ns, values


def _stamped(start: int, number: int, length: int) -> np.dtype[Any]:
    return np.dtype(
        {
            "names": ["order", "sec", "nanosec", "text", "values"],
            "formats": ["u1", "<i4", "<u4", "<u4", ("<f8", (number,))],
            "offsets": [1, 4, 8, 12, start],
            "itemsize": length,
        }
    )


def decode_stamps(rows: Rows) -> Stamps:
    """Stamps (ns), shape (n,), of messages that begin with a header: `rows` (n, length) bytes."""
    second = rows[:, 4:8].copy().view("<i4")[:, 0].astype(np.int64)
    return second * 1_000_000_000 + rows[:, 8:12].copy().view("<u4")[:, 0].astype(np.int64)


def decode_joint_positions(raw: list[bytes], names: tuple[str, ...], first: Floats) -> tuple[Stamps, Floats]:
    """Decode the angles of sensor_msgs/JointState that all name the same axes.

    Parameters
    ----------
    raw : list of bytes, length n
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
    if len(set(map(len, raw))) != 1:
        raise LayoutError("lengths differ")
    rows = np.frombuffer(b"".join(raw), np.uint8).reshape(len(raw), -1)
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
