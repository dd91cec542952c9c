"""A simulated three-axis rate table: a plan becomes the exact motion of the platform.

Frames: n (North-East-Down at the site), t (platform). The platform's X, Y, Z point North, East and Down
when every axis angle is zero.
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
