"""Cycles at rest, joined to one a second: what a day of standing still needs in memory is a tenth.

A cycle is short so that a turning table keeps the series of its corrections of low order. At rest the body turns by the
Earth and by its noise, 1e-4 rad a second. The joined cycle has the same rotation and the same velocity increment as
its parts one after the other: the coning and sculling of the whole are what its sums leave open (Savage, eqs. (48) and
(55)-(57) of `navigation.strapdown`, which are sums over parts of any length).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.data.epochs import Epochs
from sdimu_calibration.core.data.phases import Phases
from sdimu_calibration.core.matrix3 import applied, multiplied, rotation3, store
from sdimu_calibration.core.navigation.strapdown import Cycles, velocity_increment
from sdimu_calibration.core.rotation import rotation_vector

_AFTER_TURN = 10
"""Number of epochs at the start of a stop whose cycles stay: what settles after a turn changes within a second."""


def standing(phases: Phases) -> Bools:
    """Epochs whose cycles may be joined: in a dwell that is measured, some seconds after its begin.

    Returns
    -------
    ndarray of bool, shape (e,)
    """
    index = np.arange(len(phases.used))
    begun = np.maximum.accumulate(np.where(phases.used, -1, index))
    return np.asarray(phases.used & (index - begun > _AFTER_TURN))


def join(cycles: Cycles, epochs: Epochs, still: Bools) -> tuple[Cycles, Epochs]:
    """Make one cycle of all cycles of an epoch, where it stands still.

    Parameters
    ----------
    cycles : Cycles
        Those of the epochs, and no others.
    epochs : Epochs
        Of e epochs.
    still : ndarray of bool, shape (e,)

    Returns
    -------
    cycles : Cycles
    epochs : Epochs
        The same, with the numbers of the new cycles.
    """
    count = epochs.last - epochs.first
    first_of_epoch = np.zeros(len(cycles), dtype=bool)
    first_of_epoch[epochs.first] = True
    begin = np.flatnonzero(first_of_epoch | ~np.repeat(still, count))
    last = np.append(begin[1:], len(cycles)) - 1

    def total(values: Any) -> Any:
        return np.add.reduceat(values, begin)

    alpha, upsilon = total(cycles.alpha), total(cycles.upsilon)
    coning, sculling = cycles.coning[begin], cycles.sculling[begin]
    _join(cycles.alpha, cycles.upsilon, cycles.coning, cycles.sculling, begin, last, alpha, upsilon, coning, sculling)
    joined = Cycles(
        cycles.t[last],
        total(cycles.dt),
        alpha,
        upsilon,
        coning,
        sculling,
        total(cycles.samples),
        total(cycles.lost),
        total(cycles.gap_angle),
    )
    end = np.cumsum(np.where(still, 1, count))
    return joined, replace(epochs, first=np.append(0, end[:-1]), last=end)


@compiled
def _join(
    alpha: Floats,
    upsilon: Floats,
    coning: Floats,
    sculling: Floats,
    begin: Ints,
    last: Ints,
    alpha_sum: Floats,
    upsilon_sum: Floats,
    coning_sum: Floats,
    sculling_sum: Floats,
) -> None:
    """Fill coning (rad) and sculling (m/s) of joined cycles, given their sums; of single ones they stay."""
    C, none = np.empty((3, 3)), np.zeros(3)
    for k in range(begin.shape[0]):
        if begin[k] == last[k]:
            continue
        turned = rotation3(0.0, 0.0, 0.0)
        dv0, dv1, dv2 = 0.0, 0.0, 0.0
        for c in range(begin[k], last[k] + 1):
            u = velocity_increment(alpha[c], upsilon[c], sculling[c])
            v0, v1, v2 = applied(turned, u[0], u[1], u[2])
            dv0, dv1, dv2 = dv0 + v0, dv1 + v1, dv2 + v2
            phi = alpha[c] + coning[c]
            turned = multiplied(turned, rotation3(phi[0], phi[1], phi[2]))
        store(turned, C)
        coning_sum[k] = rotation_vector(C) - alpha_sum[k]
        without = velocity_increment(alpha_sum[k], upsilon_sum[k], none)
        sculling_sum[k, 0], sculling_sum[k, 1] = dv0 - without[0], dv1 - without[1]
        sculling_sum[k, 2] = dv2 - without[2]
