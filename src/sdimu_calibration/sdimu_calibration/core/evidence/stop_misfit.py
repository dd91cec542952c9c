"""Does every stop fit? A fault at one stop, or in one turn, drowns in the mean of the whole test."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.alignment.prepared import PreparedData
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.note import Note, Topic
from sdimu_calibration.core.probability import normal_limit
from sdimu_calibration.core.wording import Work

_KINDS = ("position", "velocity", "gyro", "accelerometer")
_FALSE_ALARM = 1e-4
"""Share of sound tests with a false alarm: whoever is sent to look at a stop must find something there."""


def stop_misfit(normalised: Floats, prepared: PreparedData) -> Note | None:
    """Name the stop and kind of measurement that fits worst, if it is no chance.

    The whitened innovations of a right model are independent standard normals, so their sum over a stop divided by
    the root of their number is one too. The largest of all stops and channels is judged with their number (Bonferroni).

    Parameters
    ----------
    normalised : ndarray, shape (e, 12)
        Whitened innovations of every epoch, NaN where nothing was measured.

    Returns
    -------
    Note or None
        One line for people.
    """
    white, stop = normalised, prepared.phases.stop
    measured = np.isfinite(white)
    numbers, place = np.unique(stop, return_inverse=True)
    total = np.zeros((len(numbers), white.shape[1]))
    count = np.zeros_like(total)
    np.add.at(total, place, np.where(measured, white, 0.0))
    np.add.at(count, place, measured)
    if not count.any():
        return None
    z = total / np.sqrt(np.maximum(count, 1.0))
    limit = normal_limit(0.5 * _FALSE_ALARM / np.count_nonzero(count))
    k, row = np.unravel_index(int(np.argmax(np.abs(z))), z.shape)
    if abs(z[k, row]) <= limit:
        return None
    kind = _KINDS[row // 3]
    told = (
        f"stop {numbers[k]} does not fit: {kind} is off by {abs(z[k, row]):.1f} sigma (chance ends at {limit:.1f}); "
        "look at the data there"
    )
    return Note(told, Topic.MISFIT, f", or run: {Work.DIAGNOSE}")
