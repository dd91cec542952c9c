"""Numbers with stamps that come one by one: in the order of their stamps, and only as long as they are asked for."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints

_ROOM = 64
"""Room at first (rows): a minute of a topic of 1 Hz."""


class RecentLog:
    """Rows in the order of their stamps.

    Parameters
    ----------
    columns : int
        Numbers a row.
    """

    def __init__(self, columns: int) -> None:
        self._ns = np.empty(_ROOM, dtype=np.int64)
        self._values = np.empty((_ROOM, columns))
        self._count = 0

    def add(self, ns: int, *values: float) -> None:
        """Take a row; of one stamp, the later is the last."""
        if self._count == len(self._ns):
            self._ns = np.concatenate([self._ns, np.empty_like(self._ns)])
            self._values = np.concatenate([self._values, np.empty_like(self._values)])
        at = end = self._count
        if end and ns < self._ns[end - 1]:
            at = int(np.searchsorted(self._ns[:end], ns, side="right"))
            self._ns[at + 1 : end + 1] = self._ns[at:end].copy()
            self._values[at + 1 : end + 1] = self._values[at:end].copy()
        self._ns[at], self._values[at] = ns, values
        self._count = end + 1

    @property
    def ns(self) -> Ints:
        """Stamps.

        Returns
        -------
        ndarray of int, shape (n,)
            Ascending (ns).
        """
        return self._ns[: self._count]

    @property
    def values(self) -> Floats:
        """Numbers of each row.

        Returns
        -------
        ndarray, shape (n, columns)
        """
        return self._values[: self._count]

    def keep(self, rows: Bools) -> None:
        """Forget all rows but these.

        Parameters
        ----------
        rows : ndarray of bool, shape (n,)
        """
        ns, values = self.ns[rows], self.values[rows]
        self._count = len(ns)
        self._ns[: self._count], self._values[: self._count] = ns, values
