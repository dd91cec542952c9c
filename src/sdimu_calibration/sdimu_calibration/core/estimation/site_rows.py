"""References of the site among the parameters of an estimator that serve."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.effects.imu_model import ImuModel
from sdimu_calibration.core.effects.references import SITE_REFERENCES
from sdimu_calibration.core.evidence.information import conditioned


def site_rows(sensors: ImuModel) -> Ints:
    """Places of the references of the site among the parameters of a model, shape (r,)."""
    behind = range(len(sensors.names) - sensors.serving, len(sensors.names))
    return np.array([k for k in behind if sensors.names[k] in SITE_REFERENCES], dtype=np.int64)


def at_site(sensors: ImuModel, covariance: Floats) -> Floats:
    """Covariance if the site were as told.

    Parameters
    ----------
    covariance : ndarray, shape (q, q)
        SI.

    Returns
    -------
    ndarray, shape (q, q)
        SI; zero in the rows of the references.
    """
    rows = site_rows(sensors)
    return conditioned(covariance, rows) if len(rows) else covariance
