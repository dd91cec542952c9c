"""Curves over a test of any length, kept small: when they have too many points, every second one is dropped."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

MOST = 240
"""Number of points of a curve: about one for every two pixels of its figure."""
_AGAIN_S = 5.0
"""Step back in time (s) by which a test is known to have begun anew; messages overtake each other by less."""


@dataclass(frozen=True)
class Drawn:
    """Curves as they are drawn."""

    t: tuple[float, ...]
    """Time of the test (s), length n."""
    values: Mapping[str, tuple[float | None, ...]]
    """Each of length n. By name; None where a curve has not begun."""


class Curves:
    """Several curves over one time, filled point by point."""

    def __init__(self) -> None:
        self._points: list[tuple[float, dict[str, float]]] = []
        self._step = 0.0

    def add(self, t: float, values: Mapping[str, float]) -> bool:
        """Add a point; whether there is anything new. `t`: time of the test (s)."""
        last = self._points[-1][0] if self._points else -1.0
        if t < last - _AGAIN_S:
            self._points, self._step, last = [], 0.0, -1.0
        if t <= last or not values:
            return False
        if len(self._points) > 1 and t - self._points[-2][0] < self._step:
            # The newest point is drawn at once; it stays when its step is full.
            self._points.pop()
        self._points.append((t, dict(values)))
        if len(self._points) > MOST:
            self._step = 2.0 * max(self._step, (t - self._points[0][0]) / MOST)
            self._points = [*self._points[:-1:2], self._points[-1]]
        return True

    def drawn(self) -> Drawn:
        """Return what is drawn now."""
        names = dict.fromkeys(name for _, values in self._points for name in values)
        return Drawn(
            tuple(t for t, _ in self._points),
            {name: tuple(values.get(name) for _, values in self._points) for name in names},
        )
