"""Columns of a tall matrix that grows at its end, with room behind them: what is there already is not copied again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints

_ROOM = 32
"""Number of columns (1) that are kept free behind a matrix: a search makes up to twenty time constants finer."""


@dataclass(eq=False)
class _Memory:
    """Columns in one piece of memory, column by column."""

    whole: Floats
    free: list[int]
    """Number of the first column that nobody has: whoever takes it out of the list may write there."""


@dataclass(frozen=True)
class Grown:
    """The first columns of a memory that may have room for more."""

    memory: _Memory | None = None
    count: int = 0

    @property
    def columns(self) -> Floats:
        """The columns, shape (N, count), in the units of what was put together."""
        return np.empty((0, 0)) if self.memory is None else self.memory.whole[:, : self.count]

    def beside(self, here: Floats, more: Floats) -> Grown:
        """Put columns behind others: into the room where these end the memory, else everything into a new one.

        Parameters
        ----------
        here : ndarray, shape (N, k)
            Copied where they are not the columns of this memory.
        more : ndarray, shape (N, m)
            In the same units.
        """
        count = here.shape[1] + more.shape[1]
        if self.memory is not None and self._ends_with(here, count):
            self.memory.whole[:, self.count : count] = more
            self.memory.free.append(count)
            return Grown(self.memory, count)
        whole = np.empty((len(here), count + _ROOM), order="F")
        whole[:, : here.shape[1]], whole[:, here.shape[1] : count] = here, more
        return Grown(_Memory(whole, [count]), count)

    def holds(self, here: Floats) -> bool:
        """Whether columns are the first ones of this memory.

        Parameters
        ----------
        here : ndarray, shape (N, k)
            Any unit.
        """
        if self.memory is None or here.base is not self.memory.whole:
            return False
        whole = self.memory.whole
        begins = here.ctypes.data == whole.ctypes.data
        return begins and here.strides == whole.strides and len(here) == len(whole)

    def _ends_with(self, here: Floats, count: int) -> bool:
        """Take the room behind some columns, up to `count`; whether they end the memory and it has so much."""
        memory = self.memory
        if memory is None or not self.holds(here) or here.shape[1] != self.count or count > memory.whole.shape[1]:
            return False
        try:
            memory.free.remove(self.count)
        except ValueError:
            return False
        return True

    def __reduce__(self) -> tuple[type[Grown], tuple[()]]:
        """Leave the memory behind where an evidence goes to another process: its columns go by themselves."""
        return Grown, ()


NOT_GROWN = Grown()
"""No memory yet: the first columns that come are copied."""


def chosen(W: Floats, columns: Ints) -> Floats:
    """Copy some columns of a matrix, column by column in memory.

    Parameters
    ----------
    W : ndarray, shape (N, q)
        Any unit.
    columns : ndarray of int, shape (k,)

    Returns
    -------
    ndarray, shape (N, k)
        In the unit of W.
    """
    return np.take(W.T, columns, axis=0).T
