"""The place of a bag that is made: free, or held by a bag that may be replaced; never anything else."""

from __future__ import annotations

import fcntl
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from sdimu_calibration.core.data_error import DataError
from sdimu_calibration.storage.bags.bag_metadata import METADATA, named_files, read_metadata
from sdimu_calibration.storage.files.whole_file import beside, same_file, uninterrupted

DAMAGED_SUFFIX = ".damaged"
"""At the name of a file that was mended: the cut one, kept."""
_SQLITE = ("-wal", "-shm", "-journal")
"""At the names of what SQLite leaves beside its files."""


FileState = tuple[Path, int, int, int, int]
"""A file as it is now: path, size (bytes), time of its last change (ns), number on its disk, and the time (ns) that no
program sets: a copy that keeps times, written into the file, shows there alone."""


def hold(stream: IO[bytes]) -> None:
    """Hold an open file until it is closed; the system lets go of that of a writer that was killed."""
    # A file system without locks still has the file.
    with suppress(OSError):
        fcntl.flock(stream.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)


@contextmanager
def held(files: Iterable[Path]) -> Iterator[None]:
    """Hold the files of a bag that is changed in its place; DataError where one of them is held already."""
    streams: list[IO[bytes]] = []
    try:
        for file in files:
            stream = file.open("rb")
            streams.append(stream)
            with _refused(file):
                fcntl.flock(stream.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        for held_stream in streams:
            held_stream.close()


@contextmanager
def _refused(file: Path) -> Iterator[None]:
    """Tell a file that another process holds from a file system without locks, which holds nothing."""
    try:
        yield
    except BlockingIOError as error:
        raise DataError(f"{file}: is being written; end the recording first") from error
    except OSError:
        return


def file_states(path: Path) -> tuple[FileState, ...]:
    """Return what tells that a file, or one in a folder, was changed; empty where nothing is there."""
    files = sorted(p for p in path.iterdir() if p.is_file()) if path.is_dir() else [path] if path.is_file() else []
    found = ((file, file.stat()) for file in files)
    return tuple((file, now.st_size, now.st_mtime_ns, now.st_ino, now.st_ctime_ns) for file, now in found)


def check_room(path: Path, replace: bool) -> None:
    """Raise DataError unless a bag can be made at `path`: nothing is there, or a bag alone that is to be replaced.

    A bag that is still being written is none: its recorder would go on in a file that no folder names any more.
    """
    if path.is_file():
        raise DataError(f"{path}: a file is in the way of the bag folder; choose another one")
    if not path.is_dir() or not any(path.iterdir()):
        return
    if not (path / METADATA).is_file():
        raise DataError(f"{path}: the folder is not empty and not a bag; choose another one")
    if not replace:
        raise DataError(f"{path}: a bag is already there; --replace replaces it, or choose another folder")
    others = sorted(_names(path) - _own(path))
    if others:
        shown = ", ".join(others[:3]) + (", ..." if len(others) > 3 else "")
        raise DataError(f"{path}: holds more than a bag ({shown}); move that away, or choose another folder")
    with held(file for file in sorted(path.iterdir()) if file.is_file()):
        pass


def check_apart(source: Path | Iterable[Path], target: Path) -> None:
    """Raise DataError when what is read would be replaced by what is written.

    Parameters
    ----------
    source : Path or iterable of Path
        Files or folders that are read.
    target : Path
        Folder to make.
    """
    folder = Path(target)
    for path in [source] if isinstance(source, Path) else source:
        if any(same_file(folder, place) for place in (path, *path.resolve().parents)):
            raise DataError(f"{target}: is where {path} is read from; choose another folder for --out")


def put_in_place(folder: Path, path: Path, replace: bool) -> None:
    """Rename `folder` to `path`; a bag that is there goes when it may be replaced, and only once the new one stands."""
    # Where a link leads, not the link.
    path = path.resolve()
    check_room(path, replace)
    with uninterrupted():
        if not path.is_dir():
            folder.rename(path)
            return
        old = beside(path)
        path.rename(old)
        try:
            folder.rename(path)
        except OSError:
            old.rename(path)
            raise
        shutil.rmtree(old)


def _names(folder: Path) -> set[str]:
    return {entry.name for entry in folder.iterdir()}


def _own(folder: Path) -> set[str]:
    """Names of what belongs to the bag in a folder."""
    files = {*named_files(read_metadata(folder)), f"{folder.name}_0.mcap"}
    return {METADATA, *(name + suffix for name in files for suffix in ("", DAMAGED_SUFFIX, *_SQLITE))}
