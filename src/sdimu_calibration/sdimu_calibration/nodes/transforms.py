"""Transforms for RViz: encoding of tf2_msgs/TFMessage, names of the frames, where they are published.

    site (East, North, Up; the fixed frame of RViz)
      '- ned (North, East, Down)
           '- table_base - table_outer - table_middle - table_inner = table_platform
                                                                       '- imu_link

The axes turn by what the encoders read. The IMU is drawn as if mounted without error: how it is really mounted nobody
knows but the truth file of a simulation.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

from sdimu_calibration.core.arrays import Floats

TRANSFORMS, STATIC = "/tf", "/tf_static"
SITE, NED, BASE, PLATFORM, IMU = "site", "ned", "table_base", "table_platform", "imu_link"
IDENTITY = (1.0, 0.0, 0.0, 0.0)
NED_IN_ENU = (0.0, 0.5**0.5, 0.5**0.5, 0.0)
"""Quaternion (w, x, y, z) of NED against ENU: half a turn about the horizontal midway between East and North."""

_NS = 1_000_000_000


class TransformMessage:
    """Encoder of one message of transforms between named frames; only stamps and rotations change.

    Parameters
    ----------
    frames : sequence of (str, str)
        Parent and child of each transform.
    """

    def __init__(self, frames: Sequence[tuple[str, str]]) -> None:
        # CDR, little endian; alignment counts from behind the four bytes of the encapsulation header.
        data = bytearray(struct.pack("<I", len(frames)))
        self._stamps, self._rotations = [], []
        for parent, child in frames:
            _pad(data, 4)
            self._stamps.append(4 + len(data))
            data += bytes(8)
            for name in (parent, child):
                _pad(data, 4)
                text = name.encode() + b"\0"
                data += struct.pack("<I", len(text)) + text
            _pad(data, 8)
            data += bytes(24)  # frames share one origin: what turns is drawn about a point
            self._rotations.append(4 + len(data))
            data += bytes(32)
        self._template = bytes((0, 1, 0, 0)) + bytes(data)

    def encode(self, stamp_ns: int, rotations: Sequence[Sequence[float]] | Floats) -> bytes:
        """Encode a message.

        Parameters
        ----------
        rotations : sequence of quaternions (w, x, y, z), one a transform
            Child against parent: maps vectors of the child to the parent.
        """
        out = bytearray(self._template)
        stamp = divmod(int(stamp_ns), _NS)
        for at, place, (w, x, y, z) in zip(self._stamps, self._rotations, rotations, strict=True):
            struct.pack_into("<iI", out, at, *stamp)
            struct.pack_into("<4d", out, place, x, y, z, w)
        return bytes(out)


def stamp_of_first(message: bytes) -> int:
    """Stamp (ns) of the first transform of a message; 0 when there is none."""
    if len(message) < 16 or message[4:8] == bytes(4):
        return 0
    sec, nanosec = struct.unpack_from("<iI", message, 8)
    return int(sec) * _NS + int(nanosec)


def about(axis: Floats, angle: float) -> Floats:
    """Quaternion (w, x, y, z) of a turn by `angle` (rad) about a unit vector (3,)."""
    return np.concatenate([[np.cos(0.5 * angle)], np.sin(0.5 * angle) * axis])


def _pad(data: bytearray, size: int) -> None:
    data += bytes(-len(data) % size)
