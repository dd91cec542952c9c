"""The pages that look at a test: a server that ends waits until each has seen the end."""

from __future__ import annotations

import threading
import time

_HERE_S = 4.0
"""Wall time (s) since which a page has asked that is still open: some of its intervals."""
_MOST = 200
"""Number of pages that are kept: the oldest is forgotten."""


class Visitors:
    """When each page asked last, and whether it knows that the test has ended."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._pages: dict[str, tuple[float, bool]] = {}

    def came(self, page: str, knows: bool) -> None:
        """Note that a page asks; `knows`: it is told the end."""
        with self._lock:
            self._pages.pop(page, None)
            while len(self._pages) >= _MOST:
                self._pages.pop(next(iter(self._pages)))
            self._pages[page] = (time.monotonic(), knows)

    def unaware(self) -> bool:
        """Tell whether a page is open that does not know the end."""
        since = time.monotonic() - _HERE_S
        with self._lock:
            return any(asked > since and not knows for asked, knows in self._pages.values())
