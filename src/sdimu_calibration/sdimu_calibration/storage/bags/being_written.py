"""The file of a bag that is being written: held by its writer, so that nobody else mends or replaces it meanwhile."""

from __future__ import annotations

import fcntl
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from sdimu_calibration.core.data_error import DataError


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
