"""Temperature profiles as YAML files (``config/temperature/``), or a soak as one number with its unit."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import ABSOLUTE_ZERO_DEGC, UnitError, parse_quantity
from sdimu_calibration.storage.files.config import Schema, find_config, read_yaml
from sdimu_calibration.storage.files.quantities import quantity
from sdimu_sim.core.temperature import TemperatureProfile

ROOM_DEGC = 25.0
"""Temperature for which the coefficients of a soak that is stated by its number hold (deg C): data sheets state them at
room temperature."""


_NUMBER = re.compile(r"[-+]?\d[\d.]*\s*[A-Za-z]*")
"""A number with or without a unit: no name of a profile."""


class _Segment(Schema):
    """``hold: 30 min``, or ``ramp: 1 degC/min`` with ``to: 70 degC``."""

    hold: Annotated[float, quantity("s"), Field(gt=0)] | None = None
    ramp: Annotated[float, quantity("degC/min"), Field(gt=0)] | None = None
    to: Annotated[float, quantity("degC"), Field(ge=ABSOLUTE_ZERO_DEGC)] | None = None

    @model_validator(mode="after")
    def _one_of_two(self) -> _Segment:
        if (self.hold is None) == (self.ramp is None) or (self.ramp is None) != (self.to is None):
            raise ValueError("expected 'hold: 30 min', or 'ramp: 1 degC/min' with 'to: 70 degC'")
        return self


class _TemperatureFile(Schema):
    format: Literal["sdimu-temperature/1"] = "sdimu-temperature/1"
    name: str | None = None
    start: Annotated[float, quantity("degC"), Field(ge=ABSOLUTE_ZERO_DEGC)]
    rise: Annotated[float, quantity("degC")] = 0.0
    tau: Annotated[float, quantity("s"), Field(gt=0)] = 1200.0
    ripple: Annotated[float, quantity("degC")] = 0.0
    ripple_period: Annotated[float, quantity("s"), Field(gt=0)] = 600.0
    segments: tuple[_Segment, ...] = ()
    reference: Annotated[float, quantity("degC")] | None = None
    sensor_lag: Annotated[float, quantity("s"), Field(ge=0)] = 0.0
    thermometer_offset: Annotated[float, quantity("degC")] = 0.0
    thermometer_noise: Annotated[float, quantity("degC"), Field(ge=0)] = 0.0
    thermometer_resolution: Annotated[float, quantity("degC"), Field(ge=0)] = 0.0


def load_temperature(text: str | Path) -> TemperatureProfile:
    """Read a temperature profile.

    `text`: name in config/temperature/, path, or the temperature of a soak with its unit, such as ``-20 degC``: its
    coefficients are stated at `ROOM_DEGC`.
    """
    if _NUMBER.fullmatch(str(text)):
        try:
            soak = parse_quantity(str(text), "degC")
        except UnitError as error:
            raise DataError(f"temperature '{text}': {error}") from error
        if soak < ABSOLUTE_ZERO_DEGC:
            raise DataError(f"temperature '{text}': expected {ABSOLUTE_ZERO_DEGC:g} degC or more")
        return TemperatureProfile(soak, reference_degc=ROOM_DEGC)
    file = read_yaml(find_config("temperature", text), _TemperatureFile)
    return TemperatureProfile(
        file.start,
        file.rise,
        file.tau,
        file.ripple,
        file.ripple_period,
        knots=_knots(file.start, file.segments),
        reference_degc=file.reference,
        sensor_lag_s=file.sensor_lag,
        offset=file.thermometer_offset,
        noise=file.thermometer_noise,
        resolution=file.thermometer_resolution,
    )


def _knots(start: float, segments: tuple[_Segment, ...]) -> tuple[tuple[float, float], ...]:
    """Turn soaks and ramps into times (s) and temperatures (deg C) between which the chamber goes straight."""
    knots = [(0.0, start)] if segments else []
    for segment in segments:
        time, value = knots[-1]
        if segment.hold is not None:
            knots.append((time + segment.hold, value))
        elif segment.ramp is not None and segment.to is not None and segment.to != value:
            knots.append((time + abs(segment.to - value) / segment.ramp, segment.to))
    return tuple(knots)
