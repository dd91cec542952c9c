"""A pipe that its reader closes (``sdimu diagnose BAG | head -3``): a verb goes on, and what it leaves is not lost."""

from __future__ import annotations

import io
import os
import stat
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import TextIO

_closed: set[int] = set()
"""Descriptors (1) whose reader has gone."""


class _UntilClosed(io.FileIO):
    """Writes to a pipe as long as somebody reads it, and to nowhere from then on."""

    def write(self, data: object, /) -> int:
        """Write bytes; none is lost that somebody still reads."""
        try:
            return super().write(data)  # type: ignore[arg-type]
        except BrokenPipeError:
            _closed.add(self.fileno())
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.fileno())
            os.close(nowhere)
            return super().write(data)  # type: ignore[arg-type]


def is_read() -> bool:
    """Whether anybody may still read stdout: a verb without an end of its own ends where nobody does."""
    return sys.__stdout__ is None or sys.__stdout__.fileno() not in _closed


@contextmanager
def outliving_readers() -> Iterator[None]:
    """Let stdout and stderr outlive their readers, so that every verb ends as it would with them."""
    with ExitStack() as stack:
        for name in ("stdout", "stderr"):
            stream = getattr(sys, name)
            # What a test or a notebook has put in its place knows itself how it is read.
            if stream is not None and stream is getattr(sys, f"__{name}__") and _is_pipe(stream):
                stack.enter_context(_guarded(name, stream))
        yield


@contextmanager
def _guarded(name: str, stream: TextIO) -> Iterator[None]:
    stream.flush()
    raw = _UntilClosed(stream.fileno(), "w", closefd=False)
    guarded = io.TextIOWrapper(
        io.BufferedWriter(raw), stream.encoding, stream.errors, line_buffering=name == "stderr", write_through=False
    )
    setattr(sys, name, guarded)
    try:
        yield
    finally:
        guarded.flush()
        setattr(sys, name, stream)


def _is_pipe(stream: TextIO) -> bool:
    """Whether another program may close what a stream writes to."""
    try:
        mode = os.fstat(stream.fileno()).st_mode
    except (OSError, ValueError):
        return False
    return stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode)
