"""One-second epochs: the beat of the filter, cut on the clock of the stamps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.navigation.strapdown import Cycles
from sdimu_calibration.core.specification import EPOCH_S


@dataclass(frozen=True)
class Epochs:
    """Which cycles make an epoch, and the means over it."""

    first: Ints
    last: Ints
    """`first`, `last`: cycles ``first:last``, shape (m,)."""
    start: Floats
    end: Floats
    """`start`, `end`: seconds, shape (m,)."""
    peak_rate: Floats
    """Largest cycle-mean body rate (rad/s), shape (m,)."""
    f_mean: Floats
    """Mean specific force as measured (m/s^2), shape (m, 3)."""
    w_mean: Floats
    """Mean body rate as measured (rad/s), shape (m, 3)."""

    def __len__(self) -> int:
        """Return the number of epochs."""
        return len(self.first)


@compiled
def _ends(t: Floats, dt: Floats, nominal: float, length: float) -> Ints:
    """Return the index after the last cycle of each whole epoch of `length` (s)."""
    ends = np.empty(t.shape[0], dtype=np.int64)
    count = 0
    start = 0
    for k in range(t.shape[0]):
        boundary = (np.floor((t[start] - dt[start] + 0.5 * nominal) / length) + 1.0) * length
        if t[k] >= boundary - 0.5 * nominal:
            ends[count] = k + 1
            count += 1
            start = k + 1
    return ends[:count]


def cut(cycles: Cycles, nominal_s: float) -> Epochs:
    """Cut cycles into whole epochs; cycles after the last whole epoch are left out.

    An epoch ends with the first cycle that reaches the next whole second after its start, so cutting
    goes on where an earlier call stopped when it is given the cycles that were left.
    """
    last = _ends(cycles.t, cycles.dt, nominal_s, EPOCH_S)
    first = np.concatenate([[0], last[:-1]]).astype(np.int64) if len(last) else last
    used = slice(0, int(last[-1]) if len(last) else 0)
    rate = np.sqrt(np.sum((cycles.alpha[used] / cycles.dt[used, None]) ** 2, axis=1))
    if not len(last):
        none, none3 = np.empty(0), np.empty((0, 3))
        return Epochs(first, last, none, none, none, none3, none3)
    length = np.add.reduceat(cycles.dt[used], first)
    return Epochs(
        first,
        last,
        cycles.t[first] - cycles.dt[first],
        cycles.t[last - 1],
        np.maximum.reduceat(rate, first),
        np.add.reduceat(cycles.upsilon[used], first) / length[:, None],
        np.add.reduceat(cycles.alpha[used], first) / length[:, None],
    )
