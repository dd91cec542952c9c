"""Sensor effects, one file per physical cause. Importing the package fills the registry."""

from sdimu_calibration.core.effects import bias, mass_unbalance, misalignment, registry, scale

__all__ = ["bias", "mass_unbalance", "misalignment", "registry", "scale"]
