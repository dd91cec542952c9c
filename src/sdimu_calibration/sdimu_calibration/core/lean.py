"""Other people's packages, loaded without what only they or their tests use of others."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np


@contextmanager
def lean() -> Iterator[None]:
    """Load scipy and numba: 0.12 s less in each process.

    scipy takes every name that numpy has, so that numpy loads its Fortran compiler and its tools for tests, too. numba
    loads `coverage` where it is installed, and uses it where it was asked for lines that were compiled.
    """
    names, listing = np.__all__, vars(np)["__dir__"]
    there = [name for name in names if name in vars(np)]
    absent = {"coverage"} - set(sys.modules)
    try:
        sys.modules.update(dict.fromkeys(absent))  # type: ignore[arg-type]
        np.__all__ = there
        vars(np)["__dir__"] = lambda: there
        yield
    finally:
        np.__all__ = names
        vars(np)["__dir__"] = listing
        for name in absent:
            del sys.modules[name]
