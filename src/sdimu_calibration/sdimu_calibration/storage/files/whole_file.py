"""Files that are whole or not there at all, and files of one run that belong together."""

from __future__ import annotations

import fcntl
import itertools
import os
import secrets
import shutil
import signal
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from sdimu_calibration.core.data_error import DataError

RESULT = "result.json"
COMPANIONS = ("report.html", "report.pdf", "diagnosis.json", "set.json")
"""Files that speak of the result.json beside them: those of an earlier run go when a new one comes. set.json
was the diagnosis of a set before diagnosis.json held it."""


def _named(error: OSError, path: Path) -> OSError:
    """Return the same error of the file that was to be written."""
    return type(error)(error.errno, error.strerror or str(error), str(path))


def same_file(one: Path, other: Path) -> bool:
    """Whether two paths lead to one file or folder, by links of any kind too."""
    if one.resolve() == other.resolve():
        return True
    try:
        return one.samefile(other)
    except OSError:
        return False


def beside(path: Path) -> Path:
    """Name of a hidden file or folder beside `path` that nobody else takes, on the same file system."""
    return path.with_name(f".{path.name}.{os.getpid()}-{secrets.token_hex(4)}.part")


def free_beside(path: Path) -> Path:
    """Name beside `path` with the first number that is free: for what must not be lost when another takes its place."""
    names = (path.with_name(f"{path.name}.{number}") for number in itertools.count(1))
    return next(name for name in names if not name.exists())


def put_aside(path: Path) -> Path | None:
    """Rename a file by `free_beside`; None where there is none."""
    return path.rename(free_beside(path)) if path.is_file() else None


def missing_folders(folder: Path) -> tuple[Path, ...]:
    """Return the folders that are to be made for `folder`, itself first, as `remove_empty` takes them away again."""
    return tuple(path for path in (folder, *folder.parents) if not path.exists())


def remove_empty(folders: Iterable[Path]) -> None:
    """Remove folders that were made for work that failed, the innermost first; one that holds something stays."""
    for folder in folders:
        with suppress(OSError):
            folder.rmdir()


@contextmanager
def _made(folder: Path) -> Iterator[None]:
    """Make a folder for what is written into it; it goes again where nothing could be."""
    new = missing_folders(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        remove_empty(new)
        raise


def write_whole(path: Path, text: str) -> None:
    """Write a text file beside its place and rename it: a reader never meets half of it; its folder is made too."""
    path = Path(path)
    if path.is_dir():
        raise DataError(f"{path}: is a folder; name a file to write")
    temporary = beside(path)
    with _made(path.parent):
        try:
            # A path may hold bytes that are no text; written so, JSON gives them back.
            temporary.write_text(text, encoding="utf-8", errors="backslashreplace")
            temporary.replace(path)
        except OSError as error:
            # A full disk names no file, and the hidden one says nothing to a reader.
            raise _named(error, path) from None
        finally:
            temporary.unlink(missing_ok=True)


@contextmanager
def written_together(folder: Path) -> Iterator[Path]:
    """Yield a folder to write the files of one run into; they come into `folder` together, or not at all.

    Two runs into one folder leave the files of the one or of the other, never some of each.

    Gives an empty folder inside `folder`, which is made when it is not there. Files of other names stay; with a new
    result the `COMPANIONS` of the old one go.
    """
    folder = Path(folder)
    part = beside(folder / "run")
    with _made(folder):
        part.mkdir()
        yield from _together(part, folder)


def _together(part: Path, folder: Path) -> Iterator[Path]:
    """Yield the folder `part`; what is then in it goes into `folder`."""
    try:
        yield part
        with _locked(folder), uninterrupted():
            files = sorted(part.iterdir(), key=lambda file: file.name in COMPANIONS)
            # First what speaks of the old result: a kill in between leaves a result alone, never a foreign report.
            for name in COMPANIONS if (part / RESULT).is_file() else ():
                (folder / name).unlink(missing_ok=True)
            for made in files:
                made.replace(folder / made.name)
    except OSError as error:
        file = Path(str(error.filename or part))
        if part not in (file, *file.parents):
            raise
        raise _named(error, folder / file.relative_to(part)) from None
    finally:
        shutil.rmtree(part, ignore_errors=True)


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Hold the folder against every other process that asks."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        # A file system without locks still has the renames close together.
        with suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Keep Ctrl-C and the request to end waiting until some renames are done."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    asked = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, lambda number, _: came.append(number)) for number in asked]
    try:
        yield
    finally:
        for number, handler in zip(asked, before, strict=True):
            signal.signal(number, handler)
        if came:
            signal.raise_signal(came[0])
