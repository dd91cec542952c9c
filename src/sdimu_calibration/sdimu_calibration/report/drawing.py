"""What all figures share: panels as plotly.js takes them, ink, signs that do without colour, layout."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.extras import needed
from sdimu_calibration.report.design.library import as_script
from sdimu_calibration.report.design.palette import LIGHT, paint
from sdimu_calibration.report.design.plotly_template import template

if TYPE_CHECKING:
    from plotly.graph_objects import Figure as Live

BEFORE, AFTER, BEFORE_PALE = "@before", "@after", "@before_pale"
BAND, PALE, INK, MUTED = "@band", "@pale", "@ink", "@muted"
"""Roles of `design.palette`: "model as given", "with what was found", what was allowed, what is thin, and words."""


class Figure:
    """Traces and layout as plotly.js takes them, in a grid of panels; rows and columns count from 1, from the top left.

    The objects of the Python package check every value, which takes seconds a page: only notebooks and the workbench
    need them (`as_plotly`).

    Parameters
    ----------
    titles : sequence of str
        Above the panels, row by row.
    share_x : bool
        Panels of a column have the scale of the lowest.
    share_y : bool
        Panels of a row have the scale of the first.
    gap_x, gap_y : float
        Between panels, as a share of the figure.

    Attributes
    ----------
    data : list of dict
        Traces; arrays of numbers are kept in single precision.
    """

    def __init__(
        self,
        rows: int = 1,
        cols: int = 1,
        *,
        titles: Sequence[str] = (),
        share_x: bool = False,
        share_y: bool = False,
        gap_x: float = 0.0,
        gap_y: float = 0.0,
    ) -> None:
        self.rows, self.cols = rows, cols
        self.data: list[dict[str, Any]] = []
        self.layout: dict[str, Any] = {"annotations": [], "shapes": []}
        width, height = (1.0 - gap_x * (cols - 1)) / cols, (1.0 - gap_y * (rows - 1)) / rows
        for row, col in self._panels(None, None):
            n = self._number(row, col)
            left, low = (col - 1) * (width + gap_x), (rows - row) * (height + gap_y)
            x: dict[str, Any] = {"anchor": f"y{n}", "domain": [left, left + width]}
            y: dict[str, Any] = {"anchor": f"x{n}", "domain": [low, low + height]}
            if share_x and row < rows:
                x |= {"matches": f"x{self._number(rows, col)}", "showticklabels": False}
            if share_y and col > 1:
                y |= {"matches": f"y{self._number(row, 1)}", "showticklabels": False}
            self.layout |= {f"xaxis{n}": x, f"yaxis{n}": y}
        for title, (row, col) in zip(titles, self._panels(None, None), strict=False):
            across, up = (self.axis(letter, row, col)["domain"] for letter in "xy")
            self.annotate(
                title,
                x=0.5 * sum(across),
                y=up[1],
                xref="paper",
                yref="paper",
                xanchor="center",
                yanchor="bottom",
                font={"size": 16},
            )

    def _number(self, row: int, col: int) -> str:
        """Return what plotly.js appends to the names of the axes of a panel: nothing for the first."""
        n = (row - 1) * self.cols + col
        return str(n) if n > 1 else ""

    def _panels(self, row: int | None, col: int | None) -> Iterator[tuple[int, int]]:
        for r in range(1, self.rows + 1) if row is None else (row,):
            for c in range(1, self.cols + 1) if col is None else (col,):
                yield r, c

    def axis(self, letter: str, row: int = 1, col: int = 1) -> dict[str, Any]:
        """Axis ``x`` or ``y`` of a panel."""
        found: dict[str, Any] = self.layout[f"{letter}axis{self._number(row, col)}"]
        return found

    def add(self, kind: str, *, row: int = 1, col: int = 1, **trace: Any) -> None:
        """Add a trace of a kind (``scatter``, ``bar``, ``heatmap``, ``histogram``) to a panel."""
        n = self._number(row, col)
        self.data.append({"type": kind, **_single(trace), "xaxis": f"x{n}", "yaxis": f"y{n}"})

    def x_axes(self, *, row: int | None = None, col: int | None = None, **changes: Any) -> None:
        """Change the horizontal axes of a panel, a row, a column or all; `title` and `standoff` (px) are its words."""
        self._change("x", row, col, changes)

    def y_axes(self, *, row: int | None = None, col: int | None = None, **changes: Any) -> None:
        """Change the vertical axes, as `x_axes`."""
        self._change("y", row, col, changes)

    def _change(self, letter: str, row: int | None, col: int | None, changes: dict[str, Any]) -> None:
        if "title" in changes:
            words = {"text": changes.pop("title"), "standoff": changes.pop("standoff", None)}
            changes["title"] = {key: value for key, value in words.items() if value is not None}
        for place in self._panels(row, col):
            self.axis(letter, *place).update(changes)

    def annotate(self, text: str, *, row: int = 1, col: int = 1, **more: Any) -> None:
        """Write a text into a panel."""
        n = self._number(row, col)
        self.layout["annotations"].append({"text": text, "showarrow": False, "xref": f"x{n}", "yref": f"y{n}", **more})

    def shape(self, kind: str, *, row: int = 1, col: int = 1, **more: Any) -> None:
        """Draw a ``line`` or a ``rect`` into a panel; without `x0` from side to side, without `y0` of full height."""
        n = self._number(row, col)
        made: dict[str, Any] = {"type": kind, "xref": f"x{n}", "yref": f"y{n}", **more}
        for letter in "xy":
            if f"{letter}0" not in more:
                made |= {f"{letter}ref": f"{letter}{n} domain", f"{letter}0": 0, f"{letter}1": 1}
        self.layout["shapes"].append(made)

    def shade(self, *, row: int = 1, col: int = 1, **span: float) -> None:
        """Shade a span of a panel behind its curves: between `x0` and `x1`, or `y0` and `y1`."""
        self.shape("rect", row=row, col=col, **span, fillcolor=BAND, line={"width": 0}, layer="below")

    def band(self, x: Floats, low: Floats, high: Floats, **more: Any) -> None:
        """Fill what lies between two curves (n)."""
        self.add(
            "scatter",
            x=np.concatenate([x, x[::-1]]),
            y=np.concatenate([low, high[::-1]]),
            **{
                "fill": "toself",
                "fillcolor": BAND,
                "line": {"width": 0},
                "mode": "lines",
                "hoverinfo": "skip",
                "showlegend": False,
                **more,
            },
        )

    def as_plotly(self, theme: str = LIGHT) -> Live:
        """Return it as a `plotly.graph_objects.Figure`, for a notebook or the workbench."""
        # Slow to load, and reports do without.
        made: Live = needed("plotly.graph_objects").Figure(self.content(theme))
        return made

    def content(self, theme: str = LIGHT) -> Any:
        """Return it as plotly.js takes it, in a theme: quick, because nothing checks it."""
        return paint({"data": self.data, "layout": {"template": template(theme), **self.layout}}, theme)


def _single(value: Any) -> Any:
    """Numbers of a trace in single precision, which is finer than a screen."""
    if isinstance(value, Mapping):
        return {key: _single(part) for key, part in value.items()}
    return value.astype(np.float32) if isinstance(value, np.ndarray) and value.dtype.kind == "f" else value


def lay_out(figure: Figure, height: int, **more: Any) -> Figure:
    """Give a figure the look of the house."""
    figure.layout |= {
        "height": height,
        "hoverlabel": {"namelength": -1},
        "showlegend": False,
        "margin": {"l": 80, "r": 30, "t": 40, "b": 60},
        "legend": {"orientation": "h", "yanchor": "bottom", "y": 1.02, "x": 0},
        **more,
    }
    return figure


def literal(text: str) -> str:
    """Write a text of the user's so that plotly shows it as it is: labels may hold marks like ``<b>`` and ``<a>``."""
    return escape(text, quote=False)


def html(figure: Figure, number: int) -> str:
    """Return a figure as a part of a page; `design.sheet.document` brings the library, which draws it."""
    content = as_script({"data": figure.data, "layout": figure.layout}, _array)
    height = figure.layout["height"]
    return (
        f'<div class="figure"><div id="figure-{number}" class="plotly-graph-div" style="height:{height}px"></div>'
        f'<script type="application/json">{content}</script></div>'
    )


def _array(values: Any) -> Any:
    """Numbers as plotly.js reads them fastest: the bytes of single precision; integers and words as a list."""
    if isinstance(values, np.ndarray) and values.dtype.kind == "f":
        spec: dict[str, Any] = {"dtype": "f4", "bdata": b64encode(values.astype("<f4").tobytes()).decode("ascii")}
        return spec | ({"shape": ", ".join(map(str, values.shape))} if values.ndim > 1 else {})
    return values.tolist()
