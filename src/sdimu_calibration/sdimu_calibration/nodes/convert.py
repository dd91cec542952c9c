"""Between messages as they travel (CDR bytes) and numbers, where message objects would cost too much."""

from __future__ import annotations

import re

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.storage.bags.cdr import Layout, as_bytes

NS = 1_000_000_000

_STAMP_LABEL = re.compile(rb"stamp_ns=(-?\d+)")
_RATE, _FORCE = 13, 25  # places among the 37 doubles of an Imu message; a covariance of 9 follows each


def encode_imu(
    stamp_ns: Ints, omega_ib_b: Floats, f_ib_b: Floats, frame_id: str, omega_variance: float, f_variance: float
) -> list[bytes]:
    """Encode samples as sensor_msgs/Imu with the variances of their white noise.

    Parameters
    ----------
    stamp_ns : ndarray of int, shape (n,)
    omega_ib_b, f_ib_b : ndarray, shape (n, 3)
        Body rate (rad/s) and specific force (m/s^2).
    omega_variance, f_variance : float
        Variance of one sample, (rad/s)^2 and (m/s^2)^2, for the diagonals of the covariances.

    Returns
    -------
    list of bytes
        One message a sample; orientation_covariance[0] is -1: there is no orientation.
    """
    messages = Layout(frame_id).doubles("values", 37).rows(stamp_ns)
    values = messages["values"]
    values[:, 3] = 1.0
    values[:, 4] = -1.0
    values[:, _RATE : _RATE + 3] = omega_ib_b
    values[:, _FORCE : _FORCE + 3] = f_ib_b
    values[:, _RATE + 3 : _RATE + 12 : 4] = omega_variance
    values[:, _FORCE + 3 : _FORCE + 12 : 4] = f_variance
    return as_bytes(messages)


def stamp_of(message: bytes) -> int:
    """Stamp (ns) of the header with which a little-endian CDR message begins."""
    sec = int.from_bytes(message[4:8], "little", signed=True)
    return sec * NS + int.from_bytes(message[8:12], "little")


def stamp_in_label(message: bytes) -> int:
    """Stamp (ns) in the label ``stamp_ns=...`` of a CDR multi-array; 0 without one."""
    found = _STAMP_LABEL.search(message)
    return int(found.group(1)) if found else 0
