"""prediction.json (format ``sdimu-prediction/1``)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sdimu_calibration.core.planning.predict import Prediction
from sdimu_calibration.storage.files.json_file import entry, write_json

FORMAT = "sdimu-prediction/1"


def write_prediction(path: Path, prediction: Prediction, about: Mapping[str, Any]) -> None:
    """Write prediction.json; `about` says of what it is: plan, IMU, site, mount, noise."""
    p = prediction
    columns = {
        "name": p.names,
        "sigma": p.sigma,
        "sigma_in_noise": p.in_noise,
        "bound": p.bound,
        "prior": p.prior,
        "unit": p.units,
    }
    content = {
        "format": FORMAT,
        **about,
        **entry(p, "body_frame duration_s"),
        "coefficients": [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)],
        "unobservable": [found.text for found in p.unobservable],
        "covariance": p.covariance,
    }
    write_json(path, content)
