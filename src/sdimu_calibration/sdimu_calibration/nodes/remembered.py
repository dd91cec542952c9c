"""Samples of a journal, known again when they come a second time."""

from __future__ import annotations

from collections import deque

import numpy as np

from sdimu_calibration.core.arrays import Bools
from sdimu_calibration.core.data.stray_stamps import StampSieve
from sdimu_calibration.storage.files.journal import Samples

_REMEMBERED = 100_000
"""Number of samples at each end of a journal that are known number for number, 6 MB: another test in the same folder
begins where this one began, and a producer sends again what it has sent last."""
_STRANGERS = 10
"""More samples than these of a time that the journal has otherwise mean another test."""


class Remembered:
    """The first and the last samples of a journal; those between are known by their time alone.

    Samples with a stamp of no time of the test are not remembered: none of the test comes after one years ahead.
    """

    def __init__(self) -> None:
        self._sieve = StampSieve()
        self._head: list[Samples] = []
        self._tail: deque[Samples] = deque()
        self._counts = [0, 0]
        self._known: Samples | None = None
        self._between = (0, 0)
        self.newest_ns = 0
        """Newest stamp (ns); 0 while there is none."""

    def add(self, samples: Samples) -> None:
        """Take the next samples of the journal."""
        samples = Samples(*self._sieve.take(samples.ns, samples.omega_ib_b, samples.f_ib_b))
        if not len(samples.ns):
            return
        self.newest_ns = self._sieve.newest_ns
        if self._counts[0] < _REMEMBERED:
            self._head.append(samples)
            self._counts[0] += len(samples.ns)
            return
        self._tail.append(samples)
        self._counts[1] += len(samples.ns)
        while self._counts[1] - len(self._tail[0].ns) >= _REMEMBERED:
            dropped = self._tail.popleft()
            self._counts[1] -= len(dropped.ns)

    def settle(self) -> None:
        """Sort what was taken, once it is all there."""
        if not self._head:
            return
        self._known = _sorted([*self._head, *self._tail])
        if self._tail:
            self._between = (int(_sorted(self._head).ns[-1]), int(_sorted(list(self._tail)).ns[0]))

    def repeats(self, samples: Samples) -> Bools:
        """Which samples the journal has, number for number, shape (n,)."""
        known = self._known
        if known is None:
            return np.zeros(len(samples.ns), dtype=bool)
        at = np.minimum(np.searchsorted(known.ns, samples.ns), len(known.ns) - 1)
        same = (
            (known.ns[at] == samples.ns)
            & (known.omega_ib_b[at] == samples.omega_ib_b).all(axis=1)
            & (known.f_ib_b[at] == samples.f_ib_b).all(axis=1)
        )
        return np.asarray(same | ((samples.ns > self._between[0]) & (samples.ns < self._between[1])))

    def contradicted(self, samples: Samples) -> bool:
        """Whether the journal has other samples of the same time."""
        return int(np.sum((samples.ns <= self.newest_ns) & ~self.repeats(samples))) > _STRANGERS


def _sorted(parts: list[Samples]) -> Samples:
    columns = ([getattr(part, name) for part in parts] for name in Samples.__dataclass_fields__)
    ns, omega, force = map(np.concatenate, columns)
    order = np.argsort(ns, kind="stable")
    return Samples(ns[order], omega[order], force[order])
