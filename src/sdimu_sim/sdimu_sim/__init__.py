"""A simulated strapdown IMU on a rate table: the truth, from exact geometry.

Nothing of the calibrator's error model, navigation or filter is used here: truth and estimate meet only in
the names of coefficients. Frames n, t, b and signs as in doc/conventions.md.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    __version__: str


def __getattr__(name: str) -> Any:
    # The metadata of what is installed says the version; to read them takes longer than this import.
    if name == "__version__":
        return import_module("importlib.metadata").version(__name__)
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
