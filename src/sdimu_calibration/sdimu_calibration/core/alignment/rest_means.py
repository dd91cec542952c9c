"""Stops of a recording, and means of its samples over blocks of rest. SI units, body frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.alignment.prepared import PreparedData
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.data_error import DataError
from sdimu_calibration.core.effects.imu_model import ImuModel

BLOCK_EPOCHS = 20
"""Largest number of epochs in a mean: regressors that change slowly, such as temperature, are constant within it."""


@dataclass(frozen=True)
class Layout:
    """Cycles of stops and blocks, as half-open ranges."""

    stop_first: Ints
    stop_last: Ints
    """`stop_first`, `stop_last`: shape (k,). First cycle of each stop, and one after its last: consecutive epochs that
    the phases mark as used."""
    block_first: Ints
    block_last: Ints
    block_stop: Ints
    """`block_first`, `block_last`, `block_stop`: the same for each block of rest, and the stop it belongs to,
    shape (b,)."""


def layout(prepared: PreparedData) -> Layout:
    """Divide the used epochs into stops and blocks of at most `BLOCK_EPOCHS` epochs."""
    used = np.flatnonzero(prepared.phases.used)
    if not len(used):
        raise DataError("the recording holds no whole second at rest; check the unit of its stamps")
    starts = np.flatnonzero(np.diff(used, prepend=-2) != 1)
    ends = np.append(starts[1:], len(used))
    first, last = prepared.epochs.first, prepared.epochs.last
    blocks = [
        (k, used[i], used[min(i + BLOCK_EPOCHS, b) - 1])
        for k, (a, b) in enumerate(zip(starts, ends, strict=True))
        for i in range(a, b, BLOCK_EPOCHS)
    ]
    stop, begin, end = (np.array(column, dtype=np.int64) for column in zip(*blocks, strict=True))
    return Layout(first[used[starts]], last[used[ends - 1]], first[begin], last[end], stop)


@dataclass(frozen=True)
class Rest:
    """Means over the blocks of rest."""

    seconds: Floats
    """Length of each block (s), shape (b,)."""
    mean: Floats
    """Rate (rad/s) and force (m/s^2) as measured, shape (b, 6)."""
    design: Floats
    """Change of the means per unit of each coefficient, shape (b, 6, p)."""


def rest_means(prepared: PreparedData, where: Layout, model: ImuModel, values: Floats) -> Rest:
    """Take means over the blocks.

    Parameters
    ----------
    prepared : PreparedData
        Of n cycles.
    values : ndarray, shape (n, m)
        Regressors of every cycle (SI).
    """
    c = prepared.cycles
    integrals = np.hstack([c.dt[:, None], c.alpha, c.upsilon, values * c.dt[:, None]])
    total = np.vstack([np.zeros(integrals.shape[1]), np.cumsum(integrals, axis=0)])
    block = total[where.block_last] - total[where.block_first]
    seconds = block[:, 0]
    design = np.zeros((len(seconds), 6, len(model.prior)))
    for column, (channel, parameter) in enumerate(zip(model.channel, model.parameter, strict=True)):
        design[:, channel, parameter] += block[:, 7 + column] / seconds
    return Rest(seconds, block[:, 1:7] / seconds[:, None], design)
