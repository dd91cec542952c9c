"""How fast simulated time may run against the wall clock."""

from __future__ import annotations

import time


class Pace:
    """Times real time, counted from the first question after a restart.

    Parameters
    ----------
    speed : float
        Times real time; 0 sets no pace.
    """

    def __init__(self, speed: float) -> None:
        self._speed = speed
        self._origin: tuple[float, float] | None = None

    @property
    def runs(self) -> bool:
        """Whether there is a pace."""
        return self._speed > 0.0

    def restart(self) -> None:
        """Count anew: time stood still, or ran at another pace."""
        self._origin = None

    def allows(self, until_s: float) -> bool:
        """Whether simulated time may have reached `until_s` (s) now."""
        if not self.runs:
            return True
        if self._origin is None:
            self._origin = (time.monotonic(), until_s)
        began, from_s = self._origin
        return until_s - from_s <= self._speed * (time.monotonic() - began)
