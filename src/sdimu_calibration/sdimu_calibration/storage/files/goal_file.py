"""Goals of an adaptive test (``config/goal/*.yaml``, format ``sdimu-goal/1``) <-> the core's dataclass."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from sdimu_calibration.core.adaptive.goals import Goals
from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import UnitError, parse_quantity
from sdimu_calibration.storage.files.config import LONGEST_PLAN_S, Name, Schema, find_config, read_yaml


class _GoalFile(Schema):
    format: Literal["sdimu-goal/1"] = "sdimu-goal/1"
    name: Name | None = None
    minutes: Annotated[float, Field(gt=0, le=LONGEST_PLAN_S / 60.0)] = 60.0
    both_senses: bool = True
    limits: dict[str, str]


def load_goals(name_or_path: str | Path) -> Goals:
    """Read goals: a name in config/goal or a path."""
    path = find_config("goal", name_or_path)
    file = read_yaml(path, _GoalFile)
    limits = {}
    for effect, text in file.limits.items():
        if effect not in registry.names():
            raise DataError(f"{path}: limits.{effect}: no effect of the catalogue; sdimu effects lists them")
        try:
            limits[effect] = parse_quantity(text, registry.get(effect).parameters[0].display_unit)
        except UnitError as error:
            raise DataError(f"{path}: limits.{effect}: {error}") from error
        if not limits[effect] > 0.0:
            raise DataError(f"{path}: limits.{effect}: '{text}' must be more than zero")
    if not limits:
        raise DataError(f"{path}: limits: state one at least, such as gyro_bias: 0.016 deg/h")
    return Goals(file.name or path.stem, limits, file.minutes, file.both_senses)
