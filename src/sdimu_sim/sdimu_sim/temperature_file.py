"""Temperature profiles as YAML files (``config/temperature/``)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from sdimu_calibration.storage.config import Schema, find_config, quantity, read_yaml
from sdimu_sim.core.temperature import TemperatureProfile


class _TemperatureFile(Schema):
    format: Literal["sdimu-temperature/1"] = "sdimu-temperature/1"
    name: str | None = None
    start: Annotated[float, quantity("degC")]
    rise: Annotated[float, quantity("degC")] = 0.0
    tau: Annotated[float, quantity("s"), Field(gt=0)] = 1200.0
    ripple: Annotated[float, quantity("degC")] = 0.0
    ripple_period: Annotated[float, quantity("s"), Field(gt=0)] = 600.0


def load_temperature(name_or_path: str | Path) -> TemperatureProfile:
    """Read a temperature profile; DataError when the file is missing or wrong."""
    file = read_yaml(find_config("temperature", name_or_path), _TemperatureFile)
    return TemperatureProfile(file.start, file.rise, file.tau, file.ripple, file.ripple_period)
