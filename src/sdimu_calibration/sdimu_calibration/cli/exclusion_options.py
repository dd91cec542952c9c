"""Options that leave measurements out of a fit: whole stops, or spans of time."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Annotated

import typer

from sdimu_calibration.core.data_error import DataError

if TYPE_CHECKING:
    from sdimu_calibration.core.estimation.prepared_test import PreparedTest

ExcludeStops = Annotated[
    str | None,
    typer.Option("--exclude-stops", metavar="STOPS", help="Stops the fit does not see, such as 4,7; not the first."),
]
ExcludeTimes = Annotated[
    str | None,
    typer.Option(
        "--exclude-times", metavar="SPANS", help="Spans of s in which nothing is measured: 812-815,900-910."
    ),
]
_SPAN = re.compile(r"\s*(\d+(?:\.\d+)?)\s*-\s*(\d+(?:\.\d+)?)\s*")


def left_out(test: PreparedTest, stops: str | None, times: str | None) -> PreparedTest:
    """Leave stops and spans of time out of all fits of a test.

    Parameters
    ----------
    test : PreparedTest
    stops, times : str or None
        As the options of the same names take them.

    Raises
    ------
    DataError
        When one cannot be read.
    """
    if stops is not None:
        test = test.without_stops(read_stops(stops))
    return test if times is None else test.without_times(read_spans(times))


def read_stops(text: str) -> tuple[int, ...]:
    """Read numbers of stops, such as ``4,7``.

    Raises
    ------
    DataError
        When one is no number.
    """
    words = [word.strip() for word in text.split(",")]
    if not all(word.isdecimal() for word in words):
        raise DataError(f"--exclude-stops {text}: expected numbers of stops such as 4,7")
    return tuple(sorted({int(word) for word in words}))


def read_spans(text: str) -> tuple[tuple[float, float], ...]:
    """Read spans of time (s), such as ``812-815,900-910``.

    Raises
    ------
    DataError
        When one is no span.
    """
    found = [_SPAN.fullmatch(word) for word in text.split(",")]
    if not all(found):
        raise DataError(f"--exclude-times {text}: expected spans of seconds such as 812-815,900-910")
    return tuple(sorted((float(match[1]), float(match[2])) for match in found if match))
