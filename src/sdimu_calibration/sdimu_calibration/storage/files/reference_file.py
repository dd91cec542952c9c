"""Published results to compare with (format ``sdimu-reference/1``) and the truth of a simulation."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.effects.bias import ACCEL_BIAS, GYRO_BIAS
from sdimu_calibration.core.effects.gyro_g_sensitivity import G_SENSITIVITY
from sdimu_calibration.core.effects.mass_unbalance import GYRO_MASS_UNBALANCE
from sdimu_calibration.core.effects.misalignment import ACCEL_MISALIGNMENT
from sdimu_calibration.core.effects.scale import ACCEL_SCALE
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import parse_quantity
from sdimu_calibration.storage.files.config import find_config, read_mapping

_TRUTH_FORMAT = "sdimu-truth/1"
_REFERENCE_FORMAT = "sdimu-reference/1"
_KNOWN = frozenset((*GYRO_BIAS.labels, *ACCEL_BIAS.labels))
"""Coefficients of which every truth has some."""
_SCALE = frozenset(ACCEL_SCALE.labels)
_RESPONSES = frozenset((*ACCEL_MISALIGNMENT.labels, *GYRO_MASS_UNBALANCE.labels, *G_SENSITIVITY.labels))
"""Other coefficients that multiply the force."""


def read_reference(name_or_path: str | Path = "table33", mount: str = "1 deg") -> dict[str, float]:
    """Read published one-sigma errors.

    `name_or_path`: name in config/reference/ or path; `mount`: which column: misalignment between IMU and table. Gives
    the sigma (SI) by effect name.
    """
    path = find_config("reference", name_or_path)
    columns = _columns(path)
    if mount not in columns:
        raise DataError(f"{path}: no column '{mount}' (there are {', '.join(map(str, columns))})")
    column = columns[mount]
    units = {name: registry.get(name).parameters[0].display_unit for name in registry.names()}
    return {name: parse_quantity(column[name], unit) for name, unit in units.items() if name in column}


def read_columns(name_or_path: str | Path) -> tuple[str, ...]:
    """Read the names of the columns of a published table."""
    path = find_config("reference", name_or_path)
    return tuple(map(str, _columns(path)))


def _columns(path: Path) -> Mapping[str, Any]:
    content = read_mapping(path)
    columns = content.get("mount")
    if content.get("format") != _REFERENCE_FORMAT or not isinstance(columns, Mapping):
        raise DataError(f"{path}: not a {_REFERENCE_FORMAT} file")
    return columns


def read_truth(path: Path, body_frame: str, gravity: float | None = None) -> dict[str, float]:
    """Read the true coefficients of a simulation, as they are in a body frame.

    Parameters
    ----------
    path : Path
        File that the simulator wrote beside the bag.
    body_frame : str
        ``accelerometer_triad`` or ``prior``.
    gravity : float, optional
        Gravity that a result took by convention (m/s^2): the truth is stated as it is for one who takes that.

    Returns
    -------
    dict of str to float
        True value (SI) by coefficient name.
    """
    path = Path(path)
    content = read_mapping(path)
    if content.get("format") != _TRUTH_FORMAT:
        raise DataError(f"{path}: format is {content.get('format')!r}, expected '{_TRUTH_FORMAT}'")
    key = "coefficients" if body_frame == "prior" else f"coefficients_{body_frame}"
    values = content.get(key)
    if not isinstance(values, Mapping):
        raise DataError(f"{path}: no '{key}': the truth is not given in the body frame '{body_frame}'")
    if not _KNOWN & values.keys():
        raise DataError(f"{path}: {key}: names no coefficient that is known, such as gyro_bias_x")
    # Biases that drift or wander are estimated in the mean over the dwells.
    mean = content.get("mean_bias") or {}
    if not isinstance(mean, Mapping):
        raise DataError(f"{path}: mean_bias: expected 'NAME: number' lines in SI")
    values = {**values, **mean}
    true = {str(name): _number(path, str(name), value) for name, value in values.items()}
    return true if gravity is None else _restated(true, _gravity(path, content) / gravity)


def read_temperature(path: Path) -> float | None:
    """Read the temperature from which the coefficients of a truth count (deg C); None of a test without one."""
    value = read_mapping(Path(path)).get("reference_degc")
    return None if value is None else _number(Path(path), "reference_degc", value)


def _gravity(path: Path, content: Mapping[str, Any]) -> float:
    """Gravity at the place of a truth (m/s^2)."""
    site = content.get("site")
    if not isinstance(site, Mapping) or "latitude_deg" not in site:
        raise DataError(f"{path}: no 'site' with 'latitude_deg': needed, as the result took gravity by convention")
    if site.get("gravity_m_s2") is not None:
        return _number(path, "gravity_m_s2", site["gravity_m_s2"])
    latitude = np.radians(_number(path, "latitude_deg", site["latitude_deg"]))
    return float(earth.normal_gravity(latitude, _number(path, "height_m", site.get("height_m", 0.0))))


def _restated(true: dict[str, float], share: float) -> dict[str, float]:
    """Multiply every response to force by `share`: less force, more response, the same reading."""
    out = dict(true)
    for name, value in true.items():
        if name in _SCALE:
            out[name] = (1.0 + value) * share - 1.0
        elif name in _RESPONSES:
            out[name] = value * share
    return out


def _number(path: Path, name: str, value: Any) -> float:
    if isinstance(value, Mapping):
        value = value.get("value")
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise DataError(f"{path}: {name}: expected a number in SI")
    try:
        number = float(value)
    except OverflowError as error:
        raise DataError(f"{path}: {name}: larger than any number can be") from error
    if not math.isfinite(number):
        raise DataError(f"{path}: {name}: {number} is no size; expected a number in SI")
    return number
