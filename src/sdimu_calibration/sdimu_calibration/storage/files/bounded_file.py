"""A file that a user names, read within bounds: a device never ends, and a pipe waits for ever."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from sdimu_calibration.core.data_error import DataError


def check_regular(path: Path) -> None:
    """Raise DataError unless a path leads, by links too, to a regular file."""
    path = Path(path)
    if path.is_dir():
        raise DataError(f"{path}: is a folder; name a file")
    if not path.exists():
        raise DataError(f"{path}: no such file")
    if not path.is_file():
        raise _no_file(path)


def read_bounded(path: Path, longest: int) -> bytes:
    """Read a regular file of `longest` bytes at most.

    Raises DataError where there is none, it cannot be read, or it is longer.
    """
    path = Path(path)
    check_regular(path)
    try:
        # A pipe that has come since is opened without a wait for its writer, and then refused.
        with os.fdopen(os.open(path, os.O_RDONLY | os.O_NONBLOCK), "rb") as stream:
            if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
                raise _no_file(path)
            # The size that the system gives comes first: memory is taken for what is asked for, not for what is there.
            size = os.fstat(stream.fileno()).st_size
            content = stream.read(size + 1) if size <= longest else b""
            # A file that grows, or that the system makes as it is read.
            if len(content) > size:
                content += stream.read(longest + 1 - len(content))
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror})") from error
    if max(size, len(content)) > longest:
        raise DataError(f"{path}: longer than {longest} bytes, which no file of this kind is")
    return content


def read_text(path: Path, longest: int, encoding: str = "utf-8") -> str:
    """Read a regular file as text, as `read_bounded` does; line ends stay. UnicodeDecodeError where it is no text."""
    return read_bounded(path, longest).decode(encoding)


def _no_file(path: Path) -> DataError:
    return DataError(f"{path}: is a device or a pipe; name a file")
