"""Numbers by which a recording, and what it was fitted under, are known again."""

from __future__ import annotations

from zlib import crc32

import numpy as np

from sdimu_calibration.core.alignment.prepared import TestSetup
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.data.blocks import let_go, pieces


def checksum(*arrays: Floats) -> float:
    """Give a number that other samples do not have: the same recording is known again by it."""
    value = 0
    for array in arrays:
        for rows in pieces(len(array)):
            value = crc32(np.ascontiguousarray(array[rows]).tobytes(), value)
        let_go(array)
    return float(value)


def conditions(setup: TestSetup) -> float:
    """Give a number that another site or other noise densities do not have: they change what a likelihood means."""
    site, imu = setup.site, setup.imu
    sigmas = tuple(v for v in (site.latitude_sigma_rad, site.gravity_sigma_m_s2) if v)
    place = (site.latitude_rad, site.height_m, setup.gravity, *sigmas)
    return checksum(np.array([*place, imu.gyro_white_noise, imu.accel_white_noise]))
