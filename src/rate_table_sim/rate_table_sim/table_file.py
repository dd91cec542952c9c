"""Rate tables as YAML files (``config/table/``)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from rate_table_sim.core.specification import Imperfections, TableSpecification
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.config import Schema, find_config, quantity, read_yaml

_Axis = Literal["X", "Y", "Z"]
_Angle = Annotated[float, quantity("arcsec")]
_Size = Annotated[float, quantity("arcsec"), Field(ge=0)]


class _AxesFile(Schema):
    outer: _Axis
    middle: _Axis
    inner: _Axis


class _ImperfectionsFile(Schema):
    outer_middle_nonorthogonality: _Angle = 0.0
    middle_inner_nonorthogonality: _Angle = 0.0
    base_tilt_north: _Angle = 0.0
    base_tilt_east: _Angle = 0.0
    wobble: _Size = 0.0
    encoder_noise: _Size = 0.0
    encoder_resolution: _Size = 0.0


class _TableFile(Schema):
    format: Literal["sdimu-table/1"] = "sdimu-table/1"
    name: str | None = None
    axes: _AxesFile | Literal["free"]
    sample_rate: Annotated[float, quantity("Hz"), Field(gt=0)] = 100.0
    imperfections: _ImperfectionsFile = _ImperfectionsFile()


def load_table(name_or_path: str | Path) -> TableSpecification:
    """Read a rate table.

    Raises
    ------
    DataError
        When the file is missing or wrong, or adjacent axes are the same letter.
    """
    path = find_config("table", name_or_path)
    file = read_yaml(path, _TableFile)
    axes = None if file.axes == "free" else (file.axes.outer, file.axes.middle, file.axes.inner)
    if axes and (axes[0] == axes[1] or axes[1] == axes[2]):
        raise DataError(f"{path}: axes: adjacent axes must differ (found {', '.join(axes)})")
    sizes = file.imperfections.model_dump()
    return TableSpecification(
        name=file.name or path.stem,
        axes=axes,
        sample_rate_hz=file.sample_rate,
        imperfections=Imperfections(**{f"{name}_rad": size for name, size in sizes.items()}),
    )
