"""Which columns of a text file are accelerometers and gyros where no heading says it: by their numbers alone.

The force is the triple of columns whose length stays near gravity; the gyros are the triple with which its direction
turns. Where no turn tells, the choice is by place, and the user is told to look at it.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.storage.importing.column_scales import fit_of_turns, is_gravity, median_size
from sdimu_calibration.storage.importing.columns import Named, Pair, Three, changes
from sdimu_calibration.storage.importing.time_column import ticks

_STEADY = 0.5
"""Scatter of the length of a triple over its median from which it is no force: a hand that turns an IMU makes less."""
_STEADY_REST = 0.05
"""Scatter (1) below which a triple of the size of gravity is a second accelerometer: gyros at rest scatter more."""
_SAME = 0.95
"""Share of the change of two triples that each explains of the other (1) from which both are forces: a force may
explain the rates of a single turn, but they do not explain it."""
_MOST_FORCES = 4
"""Number of triples that are tried as the force, the steadiest first: each is tried with all others."""
_LOOKED_AT = 200_000
"""Number of samples by which the columns are told: half an hour at 100 Hz has turns, if the file has any."""


def pairs_by_numbers(numbers: Floats, rate_hz: float, accel: Sequence[Named], gyro: Sequence[Named]) -> list[Pair]:
    """Find the accelerometers and the gyros of one IMU.

    Parameters
    ----------
    numbers : ndarray, shape (n, k)
    accel, gyro : sequence of Named
        What the headings name, without a partner.
    """
    numbers = numbers[:_LOOKED_AT]
    triples = _triples(numbers)
    forces, rates = {one.columns for one in accel}, {one.columns for one in gyro}
    unsteady = {triple: _unsteady(numbers[:, list(triple)]) for triple in triples}
    steady = [triple for triple in triples if unsteady[triple] < _STEADY and triple not in rates]
    may_be_force = sorted(
        (triple for triple in steady if _as_named(triple, forces)),
        key=lambda triple: (not is_gravity(median_size(numbers[:, list(triple)])), unsteady[triple]),
    )
    may_be_rate = [triple for triple in triples if triple not in forces and _as_named(triple, rates)]
    pairs = [
        (force, rate)
        for force, rate in product(may_be_force[:_MOST_FORCES], may_be_rate)
        if not set(force) & set(rate) and not _is_force_too(numbers[:, list(force)], numbers[:, list(rate)])
    ]
    return _by_turns(numbers, rate_hz, pairs) or _by_place(pairs, unsteady)


def _as_named(triple: Three, named: set[Three]) -> bool:
    """Whether headings leave a triple to be a sensor: those that they name are the only ones."""
    return not named or triple in named


def _triples(numbers: Floats) -> list[Three]:
    """Three columns side by side, of numbers that change and are no clock."""
    usable = np.isfinite(numbers).mean(axis=0) > 0.9
    usable &= changes(numbers)
    usable &= np.array([not ticks(column) for column in numbers.T])
    return [(k, k + 1, k + 2) for k in range(numbers.shape[1] - 2) if usable[k : k + 3].all()]


def _unsteady(v: Floats) -> float:
    """Scatter of the length of vectors, shape (n, 3), as a share of it."""
    middle = median_size(v)
    size = np.linalg.norm(v, axis=1)
    size = size[np.isfinite(size)]
    return float(np.median(np.abs(size - middle)) / middle) if middle > 0.0 else np.inf


def _is_force_too(f: Floats, v: Floats) -> bool:
    """Whether a triple is what other accelerometers measure of the same force."""
    good = np.isfinite(f).all(axis=1) & np.isfinite(v).all(axis=1)
    if np.count_nonzero(good) < 2:
        return True
    if _unsteady(v) < _STEADY_REST and is_gravity(median_size(v)):
        return True
    force, other = (x[good] - x[good].mean(axis=0) for x in (f, v))
    return min(_explained(force, other), _explained(other, force)) > _SAME


def _explained(x: Floats, y: Floats) -> float:
    """Share of the change of y that is a linear function of x; both of shape (n, 3), without their means."""
    left = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]
    total = float(np.sum(y**2))
    return 1.0 - float(np.sum(left**2)) / total if total > 0.0 else 1.0


def _fits(
    numbers: Floats, rate_hz: float, pairs: Sequence[tuple[Three, Three]], any_sense: bool
) -> dict[tuple[Three, Three], tuple[bool, float]]:
    """Of the pairs that turn together whether the force is none of gravity's size, and what the turns leave (1)."""
    fits = {}
    for force, rate in pairs:
        fit = fit_of_turns(numbers[:, list(rate)], numbers[:, list(force)], rate_hz, any_sense=any_sense)
        if fit.factor is not None:
            fits[force, rate] = (not is_gravity(median_size(numbers[:, list(force)])), fit.left)
    return fits


def _by_turns(numbers: Floats, rate_hz: float, pairs: Sequence[tuple[Three, Three]]) -> list[Pair]:
    """Choose the force and the rates that turn together, by preference as they stand; none where no turn tells."""
    fits = _fits(numbers, rate_hz, pairs, False) or _fits(numbers, rate_hz, pairs, True)
    if not fits:
        return []
    best = min(fits, key=lambda pair: fits[pair])
    return [Pair("imu", *best)]


def _by_place(pairs: Sequence[tuple[Three, Three]], unsteady: dict[Three, float]) -> list[Pair]:
    """Choose the steadiest force, and beside it the rates that change most."""
    if not pairs:
        return []
    force = pairs[0][0]
    rate = min(
        (other for one, other in pairs if one == force),
        key=lambda triple: (abs(abs(triple[0] - force[0]) - 3), -unsteady[triple]),
    )
    return [Pair("imu", force, rate, doubt="no turn confirms the choice of columns: look at it")]
