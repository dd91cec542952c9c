"""Samples that a fault of the transport has made, a bit that fell over: alone, and far beyond all that the test shows.

They are taken away before anything is recognised, as samples that are not finite are: one of them makes every mean that
it enters worthless. A recording in another unit is large everywhere, a turn and a shock have neighbours, and what is
smaller is a spike (`sample_screening`).
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.data.blocks import let_go, pieces

TRIADS = ("angular_velocity", "linear_acceleration")
_FAR = 30.0
"""Ratio to the largest of all other samples from which one is far: a knock on a table reaches ten times gravity."""
_IN_A_ROW = 3
"""Number of far samples in a row at most: more are a motion."""
_SHARE = 0.01
"""Share of far samples at most: more are a property of the recording."""
_FEW = 3
"""Number of far samples that may be in any recording: the share of a short one is less than one sample."""
_TURN = np.pi
"""Angle (rad; deg where the rate is in deg/s) in one interval from which a rate is far: half a turn in a sample. Slow
sampling may see a whole turn of the table in one sample, which is large beside the noise of the rests."""


def far_samples(
    interval_s: float, omega: Floats, force: Floats, least: tuple[float, float] = (0.0, 0.0)
) -> tuple[Bools, Bools]:
    """Find samples far beyond their neighbours and all others.

    Parameters
    ----------
    interval_s : float
        Nominal interval of the samples (s).
    omega, force : ndarray, shape (n, 3)
        Rates and forces as recorded, in the order of time; what is not finite is no candidate.
    least : (float, float)
        Largest rate and force of the sound samples before these.

    Returns
    -------
    (ndarray of bool, ndarray of bool), shape (n,)
        Rates and forces that are far.
    """
    turn = _TURN / interval_s if interval_s > 0.0 else np.inf
    return _far(omega, least[0], turn), _far(force, least[1], 0.0)


def largest(x: Floats) -> float:
    """Largest size of all numbers; 0 without any.

    Parameters
    ----------
    x : ndarray, shape (n, 3)
        In any unit, finite.

    Returns
    -------
    float
        In the same unit.
    """
    return float(np.max(np.abs(x), initial=0.0))


def far_text(name: str, far: Bools, t: Floats, x: Floats) -> str:
    """Say where the first of some far samples is, and how large.

    Parameters
    ----------
    name : str
        Of the triad in the messages.
    far : ndarray of bool, shape (n,)
    t : ndarray, shape (n,)
        Time after the start (s).
    x : ndarray, shape (n, 3)
        As recorded.
    """
    first = int(np.argmax(far))
    axis = int(np.argmax(np.abs(x[first])))
    return f"{name}.{'xyz'[axis]} is {x[first, axis]:.3g} at {t[first]:.2f} s"


def _far(x: Floats, least: float, smallest: float) -> Bools:
    """Find far samples of one triad (n, 3): larger than `smallest`, `least` being usual."""
    far = np.zeros(len(x), dtype=bool)
    top = _top(x, min(max(_FEW, int(_SHARE * len(x))), len(x) - 1) + 1)
    usual = np.maximum(top[:-1], least)
    levels = top[1:][(top[1:] > _FAR * usual) & (usual > 0.0)]
    if not len(levels) or top[-1] <= smallest:
        return far
    rows, size = _from(x, float(levels[0]))
    # What is far beyond all others may have its like among what is not so far: a turn after a long rest.
    for level in levels:
        above, sizes = rows[size >= level], size[size >= level]
        far[above[_alone(above) & (sizes > smallest)]] = True
    return far


def _sizes(x: Floats) -> Floats:
    """Largest size of each sample (n, 3); 0 where one of its numbers is not finite."""
    size = np.abs(x).max(axis=1, initial=0.0)
    return np.where(np.isfinite(size), size, 0.0)


def _top(x: Floats, count: int) -> Floats:
    """Return the `count` largest sizes, ascending."""
    top = np.zeros(0)
    for rows in pieces(len(x)):
        top = np.concatenate([top, _sizes(x[rows])])
        if len(top) > count:
            top = np.partition(top, len(top) - count)[len(top) - count :]
    let_go(x)
    return np.sort(top)


def _from(x: Floats, level: float) -> tuple[Ints, Floats]:
    """Rows of the samples of at least a size, and their sizes."""
    found = []
    for rows in pieces(len(x)):
        size = _sizes(x[rows])
        here = np.flatnonzero(size >= level)
        found.append((rows.start + here, size[here]))
    return np.concatenate([rows for rows, _ in found]), np.concatenate([size for _, size in found])


def _alone(rows: Ints) -> Bools:
    """Say which of some rows, ascending, are in no longer row of neighbours than `_IN_A_ROW`."""
    run = np.cumsum(np.diff(rows, prepend=rows[:1]) > 1)
    return np.asarray(np.bincount(run)[run] <= _IN_A_ROW)
