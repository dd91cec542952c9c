"""Sensor effects, one file per physical cause. Importing the package fills the registry."""

from sdimu_calibration.core.effects import (  # noqa: I001, F401 - the order is the order of the catalogue
    registry,
    bias,
    scale,
    misalignment,
    mass_unbalance,
    accel_nonlinearity,
    accel_cross_axis,
    gyro_g_sensitivity,
    gyro_rate_nonlinearity,
    temperature,
    drift,
    motion_bias,
    settling,
    hysteresis,
    dead_band,
    magnetic,
    timing,
    lever_arm,
    references,
    selection,
)

__all__ = ["registry", "selection"]
