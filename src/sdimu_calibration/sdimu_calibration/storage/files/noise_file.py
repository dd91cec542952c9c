"""Noise sets (``config/noise/*.yaml``, format ``sdimu-noise/1``) <-> the core's dataclass."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from sdimu_calibration.core.planning.noise_set import NoiseSet
from sdimu_calibration.storage.files.config import Schema, find_config, read_yaml
from sdimu_calibration.storage.files.quantities import quantity


class _Process(Schema):
    gyro: Annotated[float, quantity("deg/h/sqrt(Hz)"), Field(gt=0)]
    accel: Annotated[float, quantity("ug/sqrt(Hz)"), Field(gt=0)]


class _Measurement(Schema):
    rate: Annotated[float, quantity("deg/h"), Field(gt=0)]
    force: Annotated[float, quantity("ug"), Field(gt=0)]
    velocity: Annotated[float, quantity("m/s"), Field(gt=0)]
    position: Annotated[float, quantity("m"), Field(gt=0)]


class _Attitude(Schema):
    level: Annotated[float, quantity("mrad"), Field(gt=0)]
    azimuth: Annotated[float, quantity("mrad"), Field(gt=0)]


class _NoiseSetFile(Schema):
    format: Literal["sdimu-noise/1"] = "sdimu-noise/1"
    name: str | None = None
    process: _Process
    measurement: _Measurement
    zero_velocity: Literal["every_epoch", "after_motion"] = "every_epoch"
    shared_noise: bool = False
    initial_attitude: _Attitude
    reference: str = ""


def load_noise(name_or_path: str | Path) -> NoiseSet:
    """Read a noise set: a name in config/noise or a path."""
    path = find_config("noise", name_or_path)
    file = read_yaml(path, _NoiseSetFile)
    return NoiseSet(
        name=file.name or path.stem,
        gyro_density=file.process.gyro,
        accel_density=file.process.accel,
        rate_sigma=file.measurement.rate,
        force_sigma=file.measurement.force,
        velocity_sigma=file.measurement.velocity,
        position_sigma=file.measurement.position,
        zero_velocity=file.zero_velocity,
        shared_noise=file.shared_noise,
        level_sigma=file.initial_attitude.level,
        azimuth_sigma=file.initial_attitude.azimuth,
        reference=file.reference,
    )
