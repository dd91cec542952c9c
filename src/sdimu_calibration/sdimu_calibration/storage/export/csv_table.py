"""Comma-separated coefficients: name, value, sigma, unit, in SI; everything is in it, the matrices are not."""

from __future__ import annotations

import csv
import io

import numpy as np

from sdimu_calibration.core.compensation import LinearModel
from sdimu_calibration.core.results import START_TEMPERATURE
from sdimu_calibration.storage.export.shared import Source, number


def texts(source: Source) -> dict[str, str]:
    """Return the text of the file."""
    c = source.calibration
    sigma = np.sqrt(np.diag(c.covariance))
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["name", "value", "sigma", "unit"])
    table.writerows([n, number(c.values[k]), number(sigma[k]), c.units[k]] for k, n in enumerate(c.names))
    start = c.data.get(START_TEMPERATURE)
    if source.linear.of_temperature and start is not None:
        table.writerow([START_TEMPERATURE, number(start), number(0.0), "degC"])
    return {"": text.getvalue()}


def cannot_hold(linear: LinearModel) -> list[str]:  # noqa: ARG001 (every form has one)
    """Say what is left out: nothing of the coefficients, but their correlations."""
    return ["correlations between coefficients (result.json has them)"]
