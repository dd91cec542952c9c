"""What came so far of a running test, kept as passes over all of it want it: cycles, epochs, phases.

Cycles at rest are joined to one a second (`data.resting_cycles`). No more than `MOST_CYCLES` are kept: then all of it
is let go, and the filter on the way goes on about what its last pass left.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TypeVar

import numpy as np

from sdimu_calibration.core.alignment.prepared import PreparedData
from sdimu_calibration.core.arrays import Ints
from sdimu_calibration.core.data.epochs import Epochs
from sdimu_calibration.core.data.gaps import Bridges
from sdimu_calibration.core.data.phases import Phases
from sdimu_calibration.core.data.resting_cycles import join, standing
from sdimu_calibration.core.navigation.strapdown import Cycles
from sdimu_calibration.core.recording import TemperatureLog

MOST_CYCLES = 50_000
"""Number of cycles (1) that are kept at most: 9 MB, two and a half hours of turns and rests of two minutes."""
_TAIL = 60
"""Number of epochs (1) that wait to be joined: an epoch by itself takes more memory than what it holds."""
Rows = TypeVar("Rows", Cycles, Epochs, Phases, Bridges)


@dataclass(frozen=True)
class Kept:
    """Epochs that follow each other, with their cycles."""

    cycles: Cycles
    epochs: Epochs
    phases: Phases
    kind: Ints
    """As in `PreparedData`, shape (e,)."""
    bridges: Bridges


class LiveHistory:
    """Epochs of a running test, from its first on."""

    def __init__(self) -> None:
        self._parts: list[Kept] = []
        self._tail: list[Kept] = []
        self._cycles = 0
        self._temperature: list[tuple[float, float]] = []
        self.closed = False
        """Nothing is kept any more."""

    def add(self, one: Kept, temperature: TemperatureLog | None) -> None:
        """Take the next epoch, and of the temperature what was measured last."""
        if self.closed:
            return
        self._tail.append(one)
        if temperature is not None and len(temperature.t):
            if not self._temperature:
                self._temperature.append((float(temperature.t[0]), float(temperature.value[0])))
            last = int(np.searchsorted(temperature.t, one.epochs.end[0] + 1e-9, side="right")) - 1
            if last >= 0 and temperature.t[last] > self._temperature[-1][0]:
                self._temperature.append((float(temperature.t[last]), float(temperature.value[last])))
        if len(self._tail) >= _TAIL:
            self._shorten()

    def close(self) -> None:
        """Let everything go."""
        self._parts, self._tail, self._temperature, self.closed = [], [], [], True

    def prepared(self) -> PreparedData | None:
        """Everything so far as passes take it; None where it is not kept any more."""
        self._shorten()
        if not self._parts:
            return None
        one, log = _joined(self._parts), None
        self._parts = [one]
        if self._temperature:
            t, value = np.array(self._temperature).T
            log = TemperatureLog(np.ascontiguousarray(t), np.ascontiguousarray(value))
        return PreparedData(one.cycles, one.epochs, one.phases, one.kind, log, one.bridges)

    def _shorten(self) -> None:
        """Join the cycles at rest of what came since the last time."""
        if self._tail:
            tail, self._tail = _joined(self._tail), []
            # How long the IMU has stood at the first of them is in what came before.
            known = tail.phases if not self._parts else _rows([self._parts[-1].phases, tail.phases])
            cycles, epochs = join(tail.cycles, tail.epochs, standing(known)[-len(tail.epochs) :])
            self._parts.append(Kept(cycles, epochs, tail.phases, tail.kind, tail.bridges))
            self._cycles += len(cycles)
        if self._cycles > MOST_CYCLES:
            self.close()


def _joined(parts: list[Kept]) -> Kept:
    """Put parts behind each other."""
    before = np.cumsum([0, *(len(part.cycles) for part in parts)])
    epochs = _rows([part.epochs for part in parts])
    shift = np.repeat(before[:-1], [len(part.epochs) for part in parts])
    epochs = Epochs(epochs.first + shift, epochs.last + shift, *(getattr(epochs, f.name) for f in fields(Epochs)[2:]))
    return Kept(
        _rows([part.cycles for part in parts]),
        epochs,
        _rows([part.phases for part in parts]),
        np.concatenate([part.kind for part in parts]),
        _rows([part.bridges for part in parts]),
    )


def _rows(parts: list[Rows]) -> Rows:
    """Put the columns of tables behind each other."""
    return type(parts[0])(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(parts[0])))
