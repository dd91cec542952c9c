"""prediction.json (format ``sdimu-prediction/1``)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sdimu_calibration.core.planning.predict import Prediction
from sdimu_calibration.storage.files.json_file import write_json

FORMAT = "sdimu-prediction/1"


def prediction_content(prediction: Prediction, about: Mapping[str, Any]) -> dict[str, Any]:
    """Put a prediction into plain data, SI; `about` says of what (plan, IMU, site, mount, noise)."""
    columns = zip(
        prediction.names,
        prediction.sigma,
        prediction.in_noise,
        prediction.bound,
        prediction.prior,
        prediction.units,
        strict=True,
    )
    return {
        "format": FORMAT,
        **about,
        "body_frame": prediction.body_frame,
        "duration_s": prediction.duration_s,
        "coefficients": [
            {"name": name, "sigma": sigma, "sigma_in_noise": noisy, "bound": bound, "prior": prior, "unit": unit}
            for name, sigma, noisy, bound, prior, unit in columns
        ],
        "unobservable": [found.text for found in prediction.unobservable],
        "covariance": prediction.covariance,
    }


def write_prediction(path: Path, prediction: Prediction, about: Mapping[str, Any]) -> None:
    """Write prediction.json."""
    write_json(path, prediction_content(prediction, about))
