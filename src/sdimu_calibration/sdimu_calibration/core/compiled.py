"""The one place that says how loops are compiled."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])

_CORE = Path(__file__).parent


@cache
def _sources_digest(folder: Path) -> str:
    digest = hashlib.sha256()
    for file in sorted({*_CORE.rglob("*.py"), *folder.glob("*.py")}):
        source = file.read_bytes()
        if b"@compiled" in source:
            digest.update(source)
    return digest.hexdigest()[:16]


def compiled(function: F) -> F:
    """Compile a loop with numba, cached on disk, without the global lock.

    Not `fastmath`: NaN must stay NaN, and the same data must give the same digits in every process.

    Numba's cache notices a change of the function's own file only, while functions of other files are compiled into it.
    So the cache's folder is named by all sources of the core, and of the function's folder, that have compiled
    functions. Constants that such a function takes from elsewhere must live in one of them too (there is a test).
    """
    folder = Path(function.__code__.co_filename).parent
    place = folder / "__pycache__"
    if "NUMBA_CACHE_DIR" not in os.environ and os.access(folder, os.W_OK):
        # A room of the core has no sources besides those of the core: they are read once for all rooms.
        sources = _CORE if folder.is_relative_to(_CORE) else folder
        numba.config.CACHE_DIR = str(place / f"numba-{_sources_digest(sources)}")
    return cast(F, numba.njit(cache=True, nogil=True, error_model="numpy")(function))
