"""The linear errors of both triads: what every run by hand determines, whatever model is asked for."""

from __future__ import annotations

LINEAR_ERRORS = (
    "gyro_bias",
    "gyro_scale",
    "gyro_misalignment",
    "gyro_g_sensitivity",
    "accel_bias",
    "accel_scale",
    "accel_misalignment",
)
"""Names in the registry."""
