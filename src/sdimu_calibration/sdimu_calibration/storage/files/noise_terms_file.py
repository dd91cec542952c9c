"""Terms of an Allan deviation as noise.json (format ``sdimu-noise-terms/1``), SI."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from sdimu_calibration.core.fleet.datasheet import NoiseOfUnit
from sdimu_calibration.core.noise import TERMS, Terms
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.config import load_imu
from sdimu_calibration.storage.files.json_file import read_json, write_json

FORMAT = "sdimu-noise-terms/1"
NAME = "noise.json"


def write_noise_terms(path: Path, recording: str, duration_s: float, terms: Mapping[str, Terms]) -> None:
    """Write noise.json.

    Parameters
    ----------
    path : Path
        File to make or replace.
    recording : str
        Name of the bag.
    duration_s : float
        Length of all rests (s).
    terms : mapping of str to Terms
        By channel.
    """
    write_json(path, {
        "format": FORMAT, "recording": recording, "duration_s": duration_s, "terms": list(TERMS),
        "channels": {
            channel: {"value": one.value, "sigma": one.sigma, "misfit": one.misfit} for channel, one in terms.items()
        },
    })  # fmt: skip


def read_noise_terms(path: Path) -> NoiseOfUnit:
    """Read noise.json, the noise.json in a folder, or the noise of an IMU file, which has no errors.

    Raises
    ------
    DataError
        When it is none of them.
    """
    path = Path(path)
    if path.suffix in {".yaml", ".yml"}:
        return _stated(path)
    path = path / NAME if path.is_dir() else path
    content = read_json(path, FORMAT)
    try:
        return NoiseOfUnit(str(content["recording"]), {
            str(channel): Terms(_four(one["value"]), _four(one["sigma"]), float(one["misfit"]))
            for channel, one in content["channels"].items()
        })  # fmt: skip
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise DataError(f"{path}: not a complete {FORMAT} file ({type(error).__name__}: {error})") from error


def _four(values: Sequence[float]) -> np.ndarray:
    return np.array(values, float).reshape(len(TERMS))


def _stated(path: Path) -> NoiseOfUnit:
    imu = load_imu(path)
    return NoiseOfUnit(path.name, stated={
        ("gyro", "white"): imu.gyro_white_noise, ("accel", "white"): imu.accel_white_noise,
        ("gyro", "instability"): imu.gyro_bias_instability, ("accel", "instability"): imu.accel_bias_instability,
        ("gyro", "random_walk"): imu.gyro_random_walk, ("accel", "random_walk"): imu.accel_random_walk,
    })  # fmt: skip
