"""The one place that says how loops are compiled."""

from __future__ import annotations

import fcntl
import hashlib
import importlib.util
import os
import re
import sys
import time
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from io import BytesIO
from itertools import islice
from pathlib import Path
from pickle import Unpickler
from typing import Any, BinaryIO, TypeVar, cast

from sdimu_calibration.core.lean import lean

with lean():
    import numba
    from llvmlite import binding
    from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile
    from numba.core.codegen import JITCodeLibrary
    from numba.core.environment import Environment, _rebuild_env
    from numba.core.registry import CPUDispatcher
    from numba.core.runtime import rtsys
    from numba.core.types.misc import unliteral

F = TypeVar("F", bound=Callable[..., Any])

_PATIENCE_S = 120.0
"""Longest wait for another process that compiles (s): the slowest function takes 15 s, on a busy machine 60."""

_MOST_LOOPS = 50
"""Number of compiled loops (1) from which a run hardly waits for others: a test, its fit and its diagnosis need 70."""

_HOW = {"nopython": True, "nogil": True, "error_model": "numpy", "boundscheck": None, "no_cfunc_wrapper": True}
"""How numba compiles: without the global lock, without a wrapper for C; a division by zero gives inf or NaN."""

_IMPORT = re.compile(rb"^from ((?:sdimu_|rate_table_sim)[\w.]*) import (\([^)]*\)|.*)$", re.MULTILINE)
"""An import from one of the three packages at the start of a line: module, names."""


class _Checked(IndexDataCacheFile):  # type: ignore[misc]
    """Numba's cache on disk, with a checksum at the end of each file: what is damaged is compiled anew.

    Damaged machine code ends the process without a word. Pickle stops reading before the checksum.
    """

    def _load_index(self) -> Any:
        return super()._load_index() if _whole(self._index_path) else {}

    def _load_data(self, name: str) -> Any:
        content = _whole(self._data_path(name))
        if not content:
            # To numba a file that has gone: it compiles.
            raise FileNotFoundError(name)
        return _Reader(BytesIO(content)).load()

    @contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[BytesIO]:
        content = BytesIO()
        yield content
        with super()._open_for_write(filepath) as file:
            file.write(content.getvalue() + _mark(content.getvalue()))


class _Reader(Unpickler):
    """Reads a compiled function without the modules of numba that its parts were written in.

    Only what gives Python objects looks into their globals, and no compiled loop does. Numba would load 25 modules for
    them, 0.04 s that a process without anything to compile does not need.
    """

    def find_class(self, module: str, name: str) -> Any:
        return _environment if name == _rebuild_env.__name__ else super().find_class(module, name)


def _environment(module: str, constants: list[Any], name: str) -> Environment:
    """Make what a part of a compiled function knows of the module that it was written in."""
    if module in sys.modules:
        return _rebuild_env(module, constants, name)
    made = Environment({"__name__": module})
    made.consts[:], made.env_name = constants, name
    return Environment._memo.setdefault(name, made)


class _Loaded(JITCodeLibrary):  # type: ignore[misc]
    """Machine code of one function; its form for the compiler is read where another function takes it in.

    Numba reads it with every function from its cache: half of the time of loading, for nothing where all is compiled.
    """

    _bitcode = b""
    _shared_module: Any

    @classmethod
    def _unserialize(cls, codegen: Any, state: Any) -> Any:
        name, kind, data = state
        if kind != "object":
            return super()._unserialize(codegen, state)
        library = codegen.create_library(name)
        library.enable_object_caching()
        machine_code, library._bitcode = data
        library._set_compiled_object(machine_code)
        library._finalize_final_module()
        return library

    def _get_module_for_linking(self) -> Any:
        if self._shared_module is None and self._bitcode:
            self._shared_module = binding.parse_bitcode(self._bitcode)
            self._codegen._engine._load_defined_symbols(self._shared_module)
        return super()._get_module_for_linking()


class _Results(CompileResultCacheImpl):  # type: ignore[misc]
    """What numba keeps of a compiled function, with `_Loaded` as its machine code."""

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        codegen, described = target_context.codegen(), payload[1]
        codegen._library_class = _Loaded
        # What numba asks for by name; it looks names up in the form for the compiler otherwise.
        codegen._engine._defined_symbols |= {described.llvm_func_name, described.llvm_cpython_wrapper_name}
        return super().rebuild(target_context, payload)


class _Cache(FunctionCache):  # type: ignore[misc]
    """Numba's cache of one function, whose machine code is used without getting the compiler ready for it.

    That takes 0.3 s in every process. What is not in the cache is compiled, and compiling gets the compiler ready
    itself; compiled code needs its memory functions alone.

    Processes that start together (nodes, workers) want the same functions: one compiles a function, the others wait
    for it. A function waits only for those that it calls, so no two processes wait for each other.
    """

    _impl_class = _Results

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._cache_file = _Checked(self._cache_path, self._impl.filename_base, self._impl.locator.get_source_stamp())
        self._turn = _Turn(Path(self._cache_path) / f"{self._impl.filename_base}.lock")

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        rtsys.initialize(target_context)
        found = self._found(sig, target_context)
        if found is None and self._turn.taken():
            found = self._found(sig, target_context)  # what another process compiled meanwhile
            if found is not None:
                self._turn.pass_on()
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        super().save_overload(sig, data)
        self._turn.pass_on()

    def _found(self, sig: Any, target_context: Any) -> Any:
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)


class _Function(CPUDispatcher):  # type: ignore[misc]
    """Compiled once for all constants that other compiled functions pass to it; numba compiles once for each."""

    def get_call_template(self, args: tuple[Any, ...], kws: dict[str, Any]) -> Any:
        return super().get_call_template(
            tuple(map(unliteral, args)), {name: unliteral(kind) for name, kind in kws.items()}
        )


class _Turn:
    """The right to compile one function, which one process has at a time; it ends with the process at the latest."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file: BinaryIO | None = None

    def taken(self) -> bool:
        """Wait for the right and take it; False where this process has it already, or the folder cannot be written."""
        if self._file is not None:
            return False
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._file = self._path.open("wb")
        except OSError:
            return False
        until = time.monotonic() + _PATIENCE_S
        while not _locked(self._file) and time.monotonic() < until:
            time.sleep(0.02)
        return True

    def pass_on(self) -> None:
        """Let the next process take the right."""
        if self._file is not None:
            self._file.close()
            self._file = None


def _locked(file: BinaryIO) -> bool:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _mark(content: bytes) -> bytes:
    return b"sum:" + zlib.crc32(content).to_bytes(4, "little")


def _whole(path: str) -> bytes:
    """Return the content of a file that ends with its checksum; nothing where that is wrong."""
    try:
        content = Path(path).read_bytes()
    except OSError:
        return b""
    return content if content[-8:] == _mark(content[:-8]) else b""


@cache
def _package(name: str) -> Path:
    """Return the folder of a package of this repository."""
    spec = importlib.util.find_spec(name)
    return Path(spec.origin).parent if spec and spec.origin else Path(name)


@cache
def _source(file: Path) -> bytes:
    """Return the text of a source with compiled functions; empty for any other file, or none."""
    try:
        source = file.read_bytes()
    except OSError:
        return b""
    return source if b"@compiled" in source else b""


def _imported(source: bytes) -> Iterator[Path]:
    """Files of this repository's packages that a source takes names from, whether or not they exist."""
    for match in _IMPORT.finditer(source):
        module, names = match.group(1).decode(), match.group(2).decode()
        top, *rest = module.split(".")
        folder = _package(top).joinpath(*rest)
        yield folder.with_suffix(".py")
        for name in re.findall(r"\w+", names):
            yield folder / f"{name}.py"


@cache
def _compiled_into(file: Path) -> frozenset[Path]:
    """Return the sources whose compiled functions can be part of those of a file, itself among them."""
    found: set[Path] = set()
    waiting = [file]
    while waiting:
        one = waiting.pop()
        if one not in found and _source(one):
            found.add(one)
            waiting += _imported(_source(one))
    return frozenset(found)


@cache
def _digest(file: Path) -> str:
    """Digest of a file and of all that is compiled into its functions."""
    digest = hashlib.sha256()
    for source in sorted(_compiled_into(file)):
        digest.update(_source(source))
    return digest.hexdigest()[:16]


def compiled(function: F) -> F:
    """Compile a loop with numba, cached on disk, without the global lock.

    Not `fastmath`: NaN must stay NaN, and the same data must give the same digits in every process. The value of a
    constant argument is not known while a function is compiled: it cannot index a tuple of mixed types or choose an
    axis.

    Numba's cache notices a change of the function's own file only, while functions of other files are compiled into it.
    So the cache's folder is named by the sources of the file and of every file with compiled functions that it imports
    from, and they from others. Constants that such a function takes from elsewhere must live in one of them too (there
    is a test). One kernel edited compiles the kernels that use it anew, and no others.
    """
    file = Path(function.__code__.co_filename)
    place = file.parent / "__pycache__"
    if "NUMBA_CACHE_DIR" not in os.environ and os.access(file.parent, os.W_OK):
        numba.config.CACHE_DIR = str(place / f"numba-{_digest(file)}")
    if numba.config.DISABLE_JIT:
        return function
    compiled_one = _Function(function, targetoptions=_HOW)
    compiled_one._cache = _Cache(function)
    return cast(F, compiled_one)


def still_to_compile() -> bool:
    """Whether most loops of this copy have not been compiled on this machine yet: all of them take about a minute.

    The set-up of a clone begins with it, and a first run waits for what is left.
    """
    place = os.environ.get("NUMBA_CACHE_DIR")
    folder = Path(place) if place else _package("sdimu_calibration")
    return sum(1 for _ in islice(folder.rglob("*.nbc"), _MOST_LOOPS)) < _MOST_LOOPS
