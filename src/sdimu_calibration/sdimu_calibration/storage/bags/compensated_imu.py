"""Compensated samples as messages: sensor_msgs/Imu with a covariance of their own each."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.compensation import Compensated
from sdimu_calibration.storage.bags.cdr import Stamps, encode_imu


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

    Returns
    -------
    list of bytes, length n
    """
    covariances = samples.omega_covariance, samples.f_covariance
    return encode_imu(np.asarray(stamp_ns), samples.omega_ib_b, samples.f_ib_b, frame_id, covariances)
