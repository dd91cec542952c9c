"""What a proposal of a map looks at: columns of a text file, or of a file of arrays."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

from numpy.typing import NDArray


class TableView(Protocol):
    """Columns with headings; `TextTable` is one as it stands."""

    path: Path
    headings: list[str]
    notes: tuple[str, ...]
    decimal: str

    @property
    def above(self) -> Sequence[str]:
        """Lines above the data."""

    def name_of(self, column: int) -> int | str:
        """Name a column, from 0, as a map does."""

    def texts(self, column: int | str) -> NDArray[Any]:
        """Read a column, from 1, as it is written."""
