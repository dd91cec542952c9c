"""A specification of an IMU written as YAML, with measured noise in place of the data sheet's."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import yaml

from sdimu_calibration.core.noise import WhiteNoise
from sdimu_calibration.core.units import from_si
from sdimu_calibration.storage.config import find_config, read_mapping

GYRO_UNIT, ACCEL_UNIT = "deg/h/sqrt(Hz)", "ug/sqrt(Hz)"


def write_measured_imu(path: Path, base: str, measured: WhiteNoise, remarks: Sequence[str]) -> None:
    """Write an IMU file that ``--imu`` takes: grade and priors of `base`, the noise as measured.

    Parameters
    ----------
    path : Path
        File to make or replace; its folder is made too.
    base : str
        IMU by name or path.
    measured : WhiteNoise
    remarks : sequence of str
        Comments for the head of the file.

    Raises
    ------
    DataError
        When the base cannot be read.
    """
    content = dict(read_mapping(find_config("imu", base)))
    content["name"] = path.stem
    content["noise"] = {
        "gyro": f"{from_si(measured.gyro, GYRO_UNIT):.5g} {GYRO_UNIT}",
        "accel": f"{from_si(measured.accel, ACCEL_UNIT):.5g} {ACCEL_UNIT}",
    }
    lines = [f"# {remark}" for remark in remarks]
    lines.append(f"# Grade and priors are those of '{base}': they are not measured here.")
    text = yaml.safe_dump(content, sort_keys=False, allow_unicode=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n" + text, encoding="utf-8")
