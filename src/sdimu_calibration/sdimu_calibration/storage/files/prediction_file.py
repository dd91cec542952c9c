"""prediction.json (format ``sdimu-prediction/1``)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, Literal

from sdimu_calibration.core.planning.predict import Prediction
from sdimu_calibration.storage.files.json_file import entry
from sdimu_calibration.storage.files.result_model import Array, Line, Number, ResultModel, Said

FORMAT: Final = "sdimu-prediction/1"


class PredictedCoefficient(ResultModel):
    """Sigmas of a coefficient (SI), as in `Prediction`."""

    name: Line
    sigma: Number
    sigma_in_noise: Number
    bound: Number
    prior: Number
    unit: Line


class PredictionFile(ResultModel):
    """prediction.json, in the order of its keys; from `plan` to `noise` it says of what it is."""

    format: Literal["sdimu-prediction/1"] = FORMAT
    plan: Line = ""
    imu: Line = ""
    site: Line = ""
    mount_deg: Line = ""
    noise: Line = ""
    body_frame: Line
    duration_s: Number
    coefficients: tuple[PredictedCoefficient, ...]
    unobservable: tuple[Said, ...]
    covariance: Array


def write_prediction(path: Path, prediction: Prediction, about: Mapping[str, Any]) -> None:
    """Write prediction.json; `about` says of what it is: plan, IMU, site, mount, noise."""
    columns = zip(
        prediction.names,
        prediction.sigma,
        prediction.in_noise,
        prediction.bound,
        prediction.prior,
        prediction.units,
        strict=True,
    )
    keys = PredictedCoefficient.model_fields
    PredictionFile.model_construct(
        format=FORMAT,
        **about,
        **entry(prediction, "body_frame duration_s covariance"),
        coefficients=tuple(
            PredictedCoefficient.model_construct(**dict(zip(keys, row, strict=True))) for row in columns
        ),
        unobservable=tuple(found.text for found in prediction.unobservable),
    ).write(path)
