"""The error of data and options; apart from all else, because the start of the command line waits for it."""

from __future__ import annotations

from sdimu_calibration.core.plain_text import one_line


class DataError(ValueError):
    """Data or options that cannot be used; its text is the one line shown to the user, whatever names are in it."""

    def __init__(self, text: str) -> None:
        super().__init__(one_line(text))
