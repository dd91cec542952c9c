"""Long arrays in pieces: what a day of samples needs in memory does not grow with temporaries of its size.

The numbers are those of the same operation on the whole array, to the last bit.
"""

from __future__ import annotations

import mmap
from collections.abc import Iterator

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints

BLOCK = 1 << 18
"""Number of samples at a time: some megabytes, in which a copy stays in the cache of the processor."""


def pieces(count: int, overlap: int = 0) -> Iterator[slice]:
    """Yield the slices that cut `count` rows into blocks, each with the `overlap` rows behind it."""
    for begin in range(0, count, BLOCK):
        yield slice(begin, min(begin + BLOCK, count) + overlap)


def median_length(x: Floats) -> float:
    """Median length of the rows.

    Parameters
    ----------
    x : ndarray, shape (n, 3)
        In any unit.

    Returns
    -------
    float
        In the same unit.
    """
    size = np.empty(len(x))
    for rows in pieces(len(x)):
        size[rows] = np.linalg.norm(x[rows], axis=1)
    let_go(x)
    return float(np.median(size, overwrite_input=True))


def all_finite(x: Floats) -> bool:
    """Whether all numbers are finite.

    Parameters
    ----------
    x : ndarray, shape (n, 3)
        In any unit.
    """
    finite = all(bool(np.isfinite(x[rows]).all()) for rows in pieces(len(x)))
    let_go(x)
    return finite


def ascending(ns: Ints) -> bool:
    """Whether every number is larger than the one before.

    Parameters
    ----------
    ns : ndarray of int, shape (n,)
        Such as stamps (ns).
    """
    return all(bool((np.diff(ns[rows]) > 0).all()) for rows in pieces(len(ns) - 1, 1))


def let_go(*arrays: Floats) -> None:
    """Leave arrays that lie in a file to the system until they are read again; those in memory stay.

    Parameters
    ----------
    *arrays : ndarray, shape (n, ...)
        In any unit; the numbers stay what they are.
    """
    for array in arrays:
        base: object = array
        while isinstance(base, np.ndarray):
            base = base.base
        held = base.obj if isinstance(base, memoryview) else base
        if isinstance(held, mmap.mmap):
            held.madvise(mmap.MADV_DONTNEED)
