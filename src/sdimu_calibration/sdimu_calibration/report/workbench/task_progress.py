"""What the server is doing for each page, for the bar that the page shows meanwhile."""

from __future__ import annotations

from collections.abc import Callable

from dash import Output

from sdimu_calibration.report.workbench.steps import BUTTONS

_WORDS = {
    "read": "Reading the recording",
    "passes": "Fitting",
    "candidates": "Looking for what is missing",
    "report": "Writing the report",
}
_MOST_PAGES = 200
_WORKING = [(Output("busy", "hidden"), False, True), (Output("tick", "disabled"), False, True)]
BUSY = [*_WORKING, *((Output(button, "disabled"), True, False) for button in BUTTONS)]
"""What a page shows while it is fitted for."""
LOOKING = [*_WORKING, (Output("candidates", "className"), "stale", "")]
"""What a page shows while candidates are scored for it."""


class TaskProgress:
    """A word and a share done by page; written by the callback that works, read by the one that asks."""

    def __init__(self) -> None:
        self._at: dict[str, tuple[str, float]] = {}

    def teller(self, page: str) -> Callable[[str, float], None]:
        """Return the progress function of a page."""

        def tell(word: str, fraction: float) -> None:
            while len(self._at) >= _MOST_PAGES and page not in self._at:
                self._at.pop(next(iter(self._at)))
            self._at[page] = (_WORDS.get(word, word), fraction)

        return tell

    def at(self, page: str) -> tuple[str, float]:
        """Word and share done (0 to 1) of a page."""
        return self._at.get(page, ("Working", 0.0))
