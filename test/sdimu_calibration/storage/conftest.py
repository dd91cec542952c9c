"""A result without history, for everything that writes and reads results."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.results import Calibration, no_history


@pytest.fixture
def small_result() -> Calibration:
    return Calibration(
        "accelerometer_triad",
        ("gyro_bias",),
        ("gyro_bias_x", "gyro_bias_y"),
        ("rad/s",) * 2,
        ("deg/h",) * 2,
        np.array([1e-6, -2e-6]),
        np.diag([1e-14, 4e-14]),
        {"nis_mean": 1.0},
        {"duration_s": 60.0},
        (),
        no_history(2),
    )
