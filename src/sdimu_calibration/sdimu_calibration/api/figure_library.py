"""The library that draws the figures of a diagnosis: plotly, under the mouse, or matplotlib, for a paper."""

from __future__ import annotations

from collections.abc import Callable
from difflib import get_close_matches
from typing import TYPE_CHECKING, Literal, TypeAlias

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.plain_text import printable
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.extras import needed
from sdimu_calibration.report.drawing import Figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Printed
    from plotly.graph_objects import Figure as Live

Library = Literal["plotly", "matplotlib"]
Either: TypeAlias = "Live | Printed"
"""A figure of either library, where the name of the library is not known before the program runs."""


def drawn(library: Library, made: Callable[[], Figure], picture: str, diagnosis: Diagnosis) -> Either:
    """Return a figure in a library: `made` by plotly, or the `picture` of a diagnosis (`report.pictures`)."""
    if library == "plotly":
        return made().as_plotly()
    if library != "matplotlib":
        near = get_close_matches(str(library), ("plotly", "matplotlib"), n=1)
        hint = f"; did you mean '{near[0]}'?" if near else ""
        raise DataError(f"library {printable(str(library))!r}: expected 'plotly' or 'matplotlib'{hint}")
    # It loads matplotlib, which is optional.
    pictures = needed("sdimu_calibration.report.pictures")
    with pictures.mpl.rc_context(pictures.STYLE):
        printed: Printed = getattr(pictures, picture)(diagnosis)
    return printed
