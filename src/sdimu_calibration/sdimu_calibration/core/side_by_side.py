"""Independent pieces of work on two cores: compiled loops and large arrays do not hold the global lock."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

A = TypeVar("A")
B = TypeVar("B")

_THREADS = 2
"""Number of threads: the cores of a small machine; more pieces at a time than there are caches for gain nothing."""


def side_by_side(work: Callable[[A], B], pieces: Iterable[A]) -> list[B]:
    """Do the same work on each of several pieces; the results are in the order of the pieces.

    The work of one piece must not change what another one reads. Each gives the digits that it gives alone.
    """
    with ThreadPoolExecutor(_THREADS) as pool:
        return list(pool.map(work, pieces))
