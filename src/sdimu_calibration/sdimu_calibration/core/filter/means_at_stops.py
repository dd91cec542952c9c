"""What the innovations say of each stop: of noise with a memory, of a missing effect."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.alignment.prepared import PreparedData
from sdimu_calibration.core.arrays import Floats, Ints


def means_at_stops(standard: Floats, prepared: PreparedData) -> tuple[Ints, Floats]:
    """Take the mean innovation of every channel at every stop, over its sigma in white noise.

    Parameters
    ----------
    standard : ndarray, shape (e, 12)
        Innovations over their sigmas (dimensionless); NaN where nothing was measured.
    prepared : PreparedData
        e epochs.

    Returns
    -------
    stop : ndarray of int, shape (s,)
    mean : ndarray, shape (s, 12)
        The mean over the m epochs of a stop, times the root of m (dimensionless); NaN where nothing was measured.
    """
    used, number = prepared.kind > 0, prepared.phases.stop
    stops = np.unique(number[used])
    out = np.full((len(stops), standard.shape[1]), np.nan)
    for row, stop in zip(out, stops, strict=True):
        values = standard[used & (number == stop)]
        count = np.isfinite(values).sum(axis=0)
        seen = count > 0
        row[seen] = np.nansum(values[:, seen], axis=0) / np.sqrt(count[seen])
    return stops, out
