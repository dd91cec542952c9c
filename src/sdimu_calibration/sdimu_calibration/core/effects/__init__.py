"""Sensor effects, one file per physical cause. Importing the package fills the registry."""

import importlib  # noqa: I001 - below, the order is the order of the catalogue
import pkgutil

from sdimu_calibration.core.effects import (  # noqa: F401
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

# A new file needs no entry above: it comes last in the catalogue.
for _module in sorted(pkgutil.iter_modules(__path__), key=lambda module: module.name):
    importlib.import_module(f"{__name__}.{_module.name}")

__all__ = ["registry", "selection"]
