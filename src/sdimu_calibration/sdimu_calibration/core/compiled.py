"""The one place that says how loops are compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """Compile a loop with numba, cached on disk, without the global lock.

    Not `fastmath`: NaN must stay NaN, and the same data must give the same digits in every process.
    """
    return cast(F, numba.njit(cache=True, nogil=True, error_model="numpy")(function))
