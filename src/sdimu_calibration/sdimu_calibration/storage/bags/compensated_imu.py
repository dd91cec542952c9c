"""Compensated samples as messages: sensor_msgs/Imu with a covariance of their own each."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.compensation import Compensated
from sdimu_calibration.storage.bags.cdr import Layout, Stamps, as_bytes

_DOUBLES = 37
_RATE, _FORCE = 13, 25
"""Places among the 37 doubles of an Imu message; a covariance of 9 follows each."""


def frame_of(body_frame: str) -> str:
    """Name the frame of compensated samples: no longer the axes of the housing, but those of the coefficients."""
    return f"imu_{body_frame}"


def encode_compensated(stamp_ns: Stamps, samples: Compensated, frame_id: str) -> list[bytes]:
    """Encode compensated samples as sensor_msgs/Imu without an orientation.

    Parameters
    ----------
    stamp_ns : ndarray, shape (n,)
    samples : Compensated
        n samples.
    frame_id : str

    Returns
    -------
    list of bytes, length n
    """
    n = len(stamp_ns)
    messages = Layout(frame_id).doubles("values", _DOUBLES).rows(np.asarray(stamp_ns))
    values = messages["values"]
    values[:, 3] = 1.0
    values[:, 4] = -1.0  # "no orientation", by the definition of the message
    parts = ((_RATE, samples.omega_ib_b, samples.omega_covariance), (_FORCE, samples.f_ib_b, samples.f_covariance))
    for place, mean, covariance in parts:
        values[:, place : place + 3] = mean
        values[:, place + 3 : place + 12] = covariance.reshape(n, 9)
    return as_bytes(messages)
