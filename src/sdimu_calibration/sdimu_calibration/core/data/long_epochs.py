"""Epochs at rest, joined to longer ones, for an IMU whose quantisation drowns a mean over a second.

The noise of neighbouring means with a quantised integral is correlated: what one second keeps the next one gives back.
A longer mean keeps the same residue, so its share falls, and what is left is nearly white (`ImuSpecification.epoch_s`).
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.data.epochs import Epochs
from sdimu_calibration.core.data.gaps import Bridges
from sdimu_calibration.core.data.phases import Phases


def long_epochs(epochs: Epochs, phases: Phases, bridges: Bridges, seconds: float) -> tuple[Epochs, Phases, Bridges]:
    """Join the epochs that measure, stop by stop.

    Parameters
    ----------
    epochs, phases, bridges : Epochs, Phases, Bridges
        Of e epochs.
    seconds : float
        Length of a joined epoch (s), half of it more or less; the pieces of a stop are equal.

    Returns
    -------
    epochs, phases, bridges : Epochs, Phases, Bridges
        Of fewer epochs; those that do not measure stay as they are.
    """
    begin = _begins(epochs, phases, seconds)
    length = epochs.end - epochs.start
    whole = np.add.reduceat(length, begin)

    def mean(values: Floats) -> Floats:
        weight = length if values.ndim == 1 else length[:, None]
        total = np.add.reduceat(values * weight, begin)
        return np.asarray(total / (whole if values.ndim == 1 else whole[:, None]))

    last = np.append(begin[1:], len(epochs)) - 1
    joined = Epochs(
        epochs.first[begin],
        epochs.last[last],
        epochs.start[begin],
        epochs.end[last],
        np.maximum.reduceat(epochs.peak_rate, begin),
        mean(epochs.f_mean),
        mean(epochs.w_mean),
    )
    seen = Phases(
        phases.dwell[begin],
        phases.used[begin],
        np.logical_or.reduceat(phases.first, begin),
        phases.stop[begin],
        np.logical_or.reduceat(phases.contradicted, begin),
        np.logical_or.reduceat(phases.denied, begin),
    )
    bridged = Bridges(
        mean(bridges.white),
        np.sqrt(np.add.reduceat(bridges.angle**2, begin)),
        np.sqrt(np.add.reduceat(bridges.velocity**2, begin)),
    )
    return joined, seen, bridged


def _begins(epochs: Epochs, phases: Phases, seconds: float) -> Ints:
    """Index of the first epoch of each joined one, shape (m,)."""
    used = phases.used
    edge = np.ones(len(used), dtype=bool)
    edge[1:] = ~used[1:] | ~used[:-1] | (phases.stop[1:] != phases.stop[:-1]) | phases.first[1:]
    starts = np.flatnonzero(edge)
    for a, b in zip(starts, np.append(starts[1:], len(used)), strict=True):
        pieces = max(round((epochs.end[b - 1] - epochs.start[a]) / seconds), 1)
        edge[a + np.arange(1, pieces) * (b - a) // pieces] = True
    return np.flatnonzero(edge)
