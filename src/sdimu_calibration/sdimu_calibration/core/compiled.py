"""The one place that says how loops are compiled."""

from __future__ import annotations

import hashlib
import os
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.runtime import rtsys

F = TypeVar("F", bound=Callable[..., Any])

_CORE = Path(__file__).parent


class _Checked(IndexDataCacheFile):  # type: ignore[misc]
    """Numba's cache on disk, with a checksum at the end of each file: what is damaged is compiled anew.

    Damaged machine code ends the process without a word. Pickle stops reading before the checksum.
    """

    def _load_index(self) -> Any:
        return super()._load_index() if _is_whole(self._index_path) else {}

    def _load_data(self, name: str) -> Any:
        if not _is_whole(self._data_path(name)):
            # To numba a file that has gone: it compiles.
            raise FileNotFoundError(name)
        return super()._load_data(name)

    @contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[BytesIO]:
        content = BytesIO()
        yield content
        with super()._open_for_write(filepath) as file:
            file.write(content.getvalue() + _mark(content.getvalue()))


class _Cache(FunctionCache):  # type: ignore[misc]
    """Numba's cache of one function, whose machine code is used without getting the compiler ready for it.

    That takes 0.3 s in every process. What is not in the cache is compiled, and compiling gets the compiler ready
    itself; compiled code needs its memory functions alone.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._cache_file = _Checked(self._cache_path, self._impl.filename_base, self._impl.locator.get_source_stamp())

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)


def _mark(content: bytes) -> bytes:
    return b"sum:" + zlib.crc32(content).to_bytes(4, "little")


def _is_whole(path: str) -> bool:
    try:
        content = Path(path).read_bytes()
    except OSError:
        return False
    return content[-8:] == _mark(content[:-8])


@cache
def _sources_digest(folder: Path) -> str:
    """Digest of the sources of the core, and of a folder outside it, that have compiled functions."""
    core = folder == _CORE
    digest = hashlib.sha256(b"" if core else _sources_digest(_CORE).encode())
    for file in sorted(folder.rglob("*.py") if core else folder.glob("*.py")):
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
    compiled_one = numba.njit(nogil=True, error_model="numpy")(function)
    if not numba.config.DISABLE_JIT:
        compiled_one._cache = _Cache(function)
    return cast(F, compiled_one)
