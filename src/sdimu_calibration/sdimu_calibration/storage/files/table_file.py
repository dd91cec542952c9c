"""Rate tables as YAML files (``config/table/``): what drives a table and what simulates one read the same file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.table.description import AxisLimits, RateTable
from sdimu_calibration.storage.files.config import Schema, find_config, read_yaml
from sdimu_calibration.storage.files.quantities import quantity

_Axis = Literal["X", "Y", "Z"]
_Arcseconds = Annotated[float, quantity("arcsec")]
_Size = Annotated[float, quantity("arcsec"), Field(ge=0)]
_GIMBALS = ("outer", "middle", "inner")
_LETTERS = ("x", "y", "z")


class _AxesFile(Schema):
    outer: _Axis
    middle: _Axis
    inner: _Axis


class _ImperfectionsFile(Schema):
    outer_middle_nonorthogonality: _Arcseconds = 0.0
    middle_inner_nonorthogonality: _Arcseconds = 0.0
    base_tilt_north: _Arcseconds = 0.0
    base_tilt_east: _Arcseconds = 0.0
    wobble: _Size = 0.0
    encoder_noise: _Size = 0.0
    encoder_resolution: _Size = 0.0


class _LimitsFile(Schema):
    rate: Annotated[float, quantity("deg/s"), Field(gt=0)] = AxisLimits.rate_rad_s
    acceleration: Annotated[float, quantity("deg/s^2"), Field(gt=0)] = AxisLimits.acceleration_rad_s2
    angle: Annotated[float, quantity("deg"), Field(gt=0)] | None = None
    cable_turns: Annotated[float, Field(gt=0)] | None = None


class TableFile(Schema):
    """Schema of a table's file."""

    format: Literal["sdimu-table/1"] = "sdimu-table/1"
    name: str | None = None
    axes: _AxesFile | Literal["free"]
    joints: Mapping[str, Annotated[str, Field(min_length=1)]] = Field(default_factory=dict)
    limits: Mapping[str, _LimitsFile] = Field(default_factory=dict)
    sample_rate: Annotated[float, quantity("Hz"), Field(gt=0)] = 100.0
    imperfections: _ImperfectionsFile = _ImperfectionsFile()


def read_table(name_or_path: str | Path) -> tuple[RateTable, TableFile]:
    """Read a rate table: what drives it needs, and the whole file."""
    path = find_config("table", name_or_path)
    file = read_yaml(path, TableFile)
    axes = None if file.axes == "free" else (file.axes.outer, file.axes.middle, file.axes.inner)
    if axes and (axes[0] == axes[1] or axes[1] == axes[2]):
        raise DataError(f"{path}: axes: adjacent axes must differ (found {', '.join(axes)})")
    names = _GIMBALS if axes else _LETTERS
    for key, stated in (("joints", file.joints), ("limits", file.limits)):
        if unknown := set(stated) - set(names):
            raise DataError(f"{path}: {key}: no axis '{min(unknown)}' (there are: {', '.join(names)})")
    first, middle, last = (file.joints.get(name, name) for name in names)
    if len({first, middle, last}) < len(names):
        raise DataError(f"{path}: joints: two axes have the same name (found {first}, {middle}, {last})")
    one, two, three = (_limits(file.limits.get(name, _LimitsFile())) for name in names)
    table = RateTable(file.name or path.stem, axes, (first, middle, last), (one, two, three), file.sample_rate)
    return table, file


def load_rate_table(name_or_path: str | Path) -> RateTable:
    """Read what drives a table; DataError as `read_table`."""
    return read_table(name_or_path)[0]


def _limits(file: _LimitsFile) -> AxisLimits:
    stated = {"angle_rad": file.angle, "cable_turns": file.cable_turns}
    return AxisLimits(file.rate, file.acceleration, **{key: v for key, v in stated.items() if v is not None})
