"""A copy of an IMU file with other numbers, as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import yaml

from sdimu_calibration.core.noise_term import TRIADS
from sdimu_calibration.core.units import from_si
from sdimu_calibration.storage.files.config import imu_mapping

_UNITS = {
    "gyro": "deg/h/sqrt(Hz)",
    "accel": "ug/sqrt(Hz)",
    "gyro_quantisation": "arcsec",
    "accel_quantisation": "mm/s",
    "gyro_bias_instability": "deg/h",
    "accel_bias_instability": "ug",
    "gyro_random_walk": "deg/h/sqrt(h)",
    "accel_random_walk": "ug/sqrt(h)",
}
"""Units of the noise in an IMU file, by key; a triad by itself is its white noise."""


def imu_text(
    base: str | Path,
    name: str,
    remarks: Sequence[str],
    noise: Mapping[str, float] | None = None,
    priors: Mapping[str, str] | None = None,
) -> str:
    """Write what an IMU file says, with other noise or priors.

    Parameters
    ----------
    base : str or Path
        IMU by name or path.
    remarks : sequence of str
        Comments for the head of the file.
    noise : mapping of str to float, optional
        By key (SI), in the place of all the noise that `base` states; zeros are left out.
    priors : mapping of str to str, optional
        By effect, as they are to stand in the file, beside those of `base`.
    """
    content = imu_mapping(base)
    content["name"] = name
    if noise is not None:
        content["noise"] = {key: _stated(key, size) for key, size in noise.items() if size or key in TRIADS}
    if priors:
        content["prior"] = {**content.get("prior", {}), **priors}
    lines = [f"# {remark}\n" for remark in remarks]
    return "".join(lines) + yaml.safe_dump(content, sort_keys=False, allow_unicode=True)


def _stated(key: str, size: float) -> str:
    """Write a size (SI) with the unit of its key: white noise, which others weigh by, with more digits."""
    return f"{from_si(size, _UNITS[key]):.{5 if key in TRIADS else 3}g} {_UNITS[key]}"
