"""Terms of an Allan deviation as noise.json (format ``sdimu-noise-terms/1``), SI."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np

from sdimu_calibration.core.fleet.datasheet import NoiseOfUnit
from sdimu_calibration.core.noise import TERMS, Terms
from sdimu_calibration.core.origin import Origin
from sdimu_calibration.storage.files.config import load_imu
from sdimu_calibration.storage.files.result_file import ORIGIN
from sdimu_calibration.storage.files.result_model import Array, Line, Number, ResultModel, complete, read_model

FORMAT: Final = "sdimu-noise-terms/1"
NAME = "noise.json"


class Channel(ResultModel):
    """Terms of one channel, in the order of `TERMS` (SI)."""

    value: Array
    sigma: Array
    misfit: float

    @property
    def terms(self) -> Terms:
        """The same as an object of the core; ValueError where it is not one number a term."""
        k = len(TERMS)
        return Terms(self.value.reshape(k), self.sigma.reshape(k), self.misfit)


class NoiseTermsFile(ResultModel):
    """noise.json, in the order of its keys."""

    format: Literal["sdimu-noise-terms/1"] = FORMAT
    recording: Line
    origin: Annotated[Origin, ORIGIN] = Origin()
    duration_s: Number = np.nan
    terms: tuple[Line, ...] = TERMS
    channels: dict[str, Channel]


def write_noise_terms(
    path: Path, recording: str, duration_s: float, terms: Mapping[str, Terms], origin: Origin | None = None
) -> None:
    """Write noise.json.

    Parameters
    ----------
    recording : str
        Name of the bag.
    duration_s : float
        Length of all rests (s).
    terms : mapping of str to Terms
        By channel.
    origin : Origin, optional
        Unit, IMU and date, as far as they are known.
    """
    NoiseTermsFile.model_construct(
        format=FORMAT,
        recording=recording,
        origin=origin or Origin(recording=recording),
        duration_s=duration_s,
        terms=TERMS,
        channels={
            channel: Channel.model_construct(value=one.value, sigma=one.sigma, misfit=one.misfit)
            for channel, one in terms.items()
        },
    ).write(path)


def read_noise_terms(path: Path) -> NoiseOfUnit:
    """Read noise.json, the noise.json in a folder, or the noise of an IMU file, which has no errors."""
    path = Path(path)
    if path.suffix in {".yaml", ".yml"}:
        return _stated(path)
    path = path / NAME if path.is_dir() else path
    file = read_model(path, NoiseTermsFile)
    with complete(path, FORMAT):
        terms = {channel: one.terms for channel, one in file.channels.items()}
        return NoiseOfUnit(file.recording, terms, origin=file.origin, path=str(path))


def _stated(path: Path) -> NoiseOfUnit:
    imu = load_imu(path)
    return NoiseOfUnit(
        path.name,
        stated={
            ("gyro", "white"): imu.gyro_white_noise,
            ("accel", "white"): imu.accel_white_noise,
            ("gyro", "instability"): imu.gyro_bias_instability,
            ("accel", "instability"): imu.accel_bias_instability,
            ("gyro", "random_walk"): imu.gyro_random_walk,
            ("accel", "random_walk"): imu.accel_random_walk,
        },
    )
