"""The noise with which a calibration weighed its samples: in its result.json, and taken from there for later use."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from sdimu_calibration.core.plain_text import one_line
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.specification import ImuSpecification
from sdimu_calibration.storage.files.config import config_folder, load_imu

KEY = "imu_noise"
"""Key of result.json; missing in older files."""
_UNITS = {
    "white_noise": ("rad_s_sqrt_hz", "m_s2_sqrt_hz"), "random_walk": ("rad_s_sqrt_s", "m_s2_sqrt_s"),
    "quantisation": ("rad", "m_s"), "bias_instability": ("rad_s", "m_s2"),
}  # fmt: skip
_KEYS = {
    f"{triad}_{kind}_{unit}": f"{triad}_{kind}"
    for kind, units in _UNITS.items() for triad, unit in zip(("gyro", "accel"), units, strict=True)
}  # fmt: skip
"""Key in the file, with its unit, and attribute of the specification."""


def as_plain(imu: ImuSpecification) -> dict[str, Any]:
    """Name, grade and noise of an IMU as result.json holds them (SI)."""
    return {"name": imu.name, "grade": imu.grade, **{key: getattr(imu, own) for key, own in _KEYS.items()}}


def from_plain(entry: Mapping[str, Any] | None) -> ImuSpecification | None:
    """Read what `as_plain` wrote; None where there is nothing.

    Raises
    ------
    ValueError, KeyError, TypeError
        When it is no noise.
    """
    if entry is None:
        return None
    sizes: dict[str, Any] = {own: float(entry[key]) for key, own in _KEYS.items()}
    if not all(math.isfinite(size) and size >= 0.0 for size in sizes.values()):
        raise ValueError(f"{KEY} holds a size below zero or none")
    named = ImuSpecification(one_line(str(entry["name"])), 0.0, 0.0, grade=one_line(str(entry["grade"])))
    return replace(named, **sizes)


def noise_for(result: Calibration, imu: str | None) -> tuple[ImuSpecification, str]:
    """Find the noise that goes with a result: of the IMU file that is named, else of the calibration itself.

    A result that does not hold it (of an older version, or of others) has that of the file in config/imu that it names,
    or of a usual IMU: a run by hand is one of a cheap sensor, and a table gyro would say thousands of times less noise.

    Parameters
    ----------
    result : Calibration
    imu : str or None
        Name or path of an IMU file; None or empty where nobody names one.

    Returns
    -------
    specification : ImuSpecification
    whose : str
        Whose noise it is, for people.

    Raises
    ------
    DataError
        When the file cannot be used.
    """
    if imu:
        return load_imu(imu), f"'{imu}' (--imu)"
    if result.imu_noise is not None:
        return result.imu_noise, f"'{result.imu_noise.name}', with which the result was calibrated"
    if result.origin.imu in {path.stem for path in (config_folder() / "imu").glob("*.yaml")}:
        return load_imu(result.origin.imu), f"'{result.origin.imu}', the IMU that the result names"
    name = "mems_by_hand" if result.estimator == "handheld" else "dtg"
    return load_imu(name), f"'{name}', as the result does not hold its noise and no --imu is given: state your own"
