"""The truth of a simulated test as a file (``sdimu-truth/1``): YAML, all SI."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import yaml

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags.file_room import check_no_source
from sdimu_calibration.storage.files.whole_file import same_file, write_whole
from sdimu_sim.core.true_coefficients import true_coefficients
from sdimu_sim.core.truth import Truth

_FORMAT = "sdimu-truth/1"


def write_truth(path: Path, truth: Truth) -> None:
    """Write the truth of a test.

    ``coefficients`` are those of the error equations in the frame in which the IMU was built (body frame
    ``prior``), ``coefficients_accelerometer_triad`` the same sensor in that frame, ``as_built`` the angles and scales
    from which it was made, all SI. The size of every named hidden effect is listed with the coefficients, so that
    an estimate finds its truth by name.

    Raises OSError when the file cannot be written.
    """
    imu = truth.imu
    content: dict[str, Any] = {
        "format": _FORMAT,
        "plan": truth.plan,
        "rate_hz": float(truth.rate_hz),
        "seed": int(truth.seed),
        "site": {
            "latitude_deg": math.degrees(truth.site.latitude_rad),
            "height_m": truth.site.height_m,
            "gravity_m_s2": truth.site.gravity_m_s2,
        },
        "coefficients": true_coefficients(imu, "prior"),
        "coefficients_accelerometer_triad": true_coefficients(imu, "accelerometer_triad"),
        "as_built": {name: float(value) for name, value in imu.coefficients.items()},
        "mount_rad": [float(v) for v in imu.mount_rad],
        "noise": {
            "gyro_rad_s_sqrt_hz": float(imu.gyro_white_noise),
            "accel_m_s2_sqrt_hz": float(imu.accel_white_noise),
            "coloured": list(imu.noise),
        },
        "effects": list(imu.effects),
        "mean_bias": {name: float(value) for name, value in truth.mean_bias.items()},
        "reference_degc": truth.reference_degc,
        "lever_arm_m": [float(v) for v in imu.lever_arm_m],
        "magnetic_field_t": [float(v) for v in imu.magnetic_field],
        "electronics": {
            "gyro_step_rad": float(imu.gyro_step_rad),
            "accel_step_m_s": float(imu.accel_step_m_s),
            "gyro_limit_rad_s": _finite(imu.gyro_limit_rad_s),
            "accel_limit_m_s2": _finite(imu.accel_limit_m_s2),
        },
    }
    write_whole(path, yaml.dump(content, Dumper=_Exact, sort_keys=False, allow_unicode=True))


def check_truth_room(path: Path, bag: Path, replace: bool) -> None:
    """Raise DataError unless a truth can be written to `path`: nothing is there, or a truth that may be replaced.

    The truth of a bag that is gone, in its usual place, may always go too.

    `path`, `bag`: of the truth, and of the bag that is made; `replace`: what is there may be replaced.
    """
    if same_file(path, bag):
        raise DataError(f"{path}: is a folder; name a file with --truth")
    if any(same_file(folder, bag) for folder in path.resolve().parents):
        raise DataError(f"{path}: stands in the bag that is made; name a file outside it with --truth")
    check_no_source(path, "--truth")
    if not os.path.lexists(path):
        return
    if not _is_truth(path):
        raise DataError(f"{path}: another file than a truth file is there; name another place with --truth")
    if not replace and (path != usual_truth(bag) or bag.exists()):
        raise DataError(f"{path}: a truth file is already there; --replace replaces it, or name another with --truth")


def usual_truth(bag: Path) -> Path:
    """Place of the truth file of a bag where none is stated."""
    return bag.with_name(f"{bag.name}.truth.yaml")


def _is_truth(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return file.readline(100).strip() == f"format: {_FORMAT}".encode()
    except OSError:
        return False


class _Exact(yaml.SafeDumper):
    """Floats with a point and a signed exponent, so that YAML and JSON readers agree that they are numbers."""


def _represent_float(dumper: yaml.SafeDumper, value: float) -> yaml.ScalarNode:
    mantissa, e, exponent = repr(value).partition("e")
    if e and "." not in mantissa:
        mantissa += ".0"
    return dumper.represent_scalar("tag:yaml.org,2002:float", mantissa + e + exponent)


_Exact.add_representer(float, _represent_float)


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
