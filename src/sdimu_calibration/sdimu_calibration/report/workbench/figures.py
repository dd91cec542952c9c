"""Figures that only the workbench has: residuals against any variable, the ladder of fits; and their sizes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.evidence.consistency import CHANNEL_NAMES
from sdimu_calibration.report import data, evidence_figures
from sdimu_calibration.report.cost import InUse, metres
from sdimu_calibration.report.drawing import AFTER, BAND, BEFORE, PALE, Figure, lay_out, literal
from sdimu_calibration.report.may_be import MayBe
from sdimu_calibration.report.workbench.axes import TIME
from sdimu_calibration.report.workbench.fit import Fitted

_FONT = 13
HEIGHT = 297
"""Height of a figure (px): two rows of them and the bar fit on a screen of 900."""
_CELL = 10
"""Size of the numbers in the cells (px): with it those of 19 stops stand beside each other."""
_MOST_NUMBERED = 20
"""Number of stops whose numbers stand beside each other in the column of the heat map on a screen of 1440."""
_MOST_BARS = 14
_BAR_FONT = 11
"""Size of the words behind a bar (px): they are no higher than it."""
_END, _BESIDE = 1.05, 1.4
"""Width of the axis of candidates as a multiple of the longest bar, and where a probability stands behind it (1)."""
_SHORT = {"l": 55, "r": 10, "t": 8, "b": 42}


def heat_map(grid: data.Grid, cell: tuple[int, int], most: int = _MOST_NUMBERED) -> Figure:
    """Heat map of the report with a frame around the cell that is looked at.

    `most`: number of stops whose numbers stand beside each other.
    """
    figure = evidence_figures.heat_map(grid)
    row, column = cell[0], int(np.searchsorted(grid.stops, cell[1]))
    figure.shape(
        "rect",
        x0=column - 0.5,
        x1=column + 0.5,
        y0=row - 0.5,
        y1=row + 0.5,
        fillcolor="rgba(0, 0, 0, 0)",
        line={"color": BEFORE, "width": 3},
    )
    if len(grid.stops) > most:
        # Numbers would run into each other: the sign of what stands out, the number under the mouse.
        signs = [[evidence_figures.sign(value) for value in row] for row in grid.value]
        figure.data[0] |= {"text": signs}
    # Colours repeat what the numbers say: their scale would take the room of three stops.
    figure.data[0] |= {"showscale": False, "textfont": {"size": _CELL}}
    figure.layout |= {"height": HEIGHT, "margin": _SHORT | {"l": 80}}
    figure.y_axes(title="channel", standoff=0)
    return figure


def most_numbered(look: Any) -> int:
    """Return how many stops the page has room for with their numbers, as its look says it."""
    return int(look.get("stops", _MOST_NUMBERED))


def ranking(entries: Sequence[data.Scored], threshold: float, classes: Mapping[str, MayBe] | None = None) -> Figure:
    """Ranking of the report, without the sizes: the candidate that is looked at has its own beside it.

    `classes`: as `evidence_figures.ranking` takes them. What looks the same as an effect that was found shares its bar,
    behind which stands how probable it is that one of them is missing.
    """
    figure = evidence_figures.ranking(entries, threshold, classes, _MOST_BARS)
    bars, words = figure.data[:2]
    words |= {"text": [evidence_figures.beside(p) for p in words["customdata"]], "textfont": {"size": _BAR_FONT}}
    room = _BESIDE if any(words["customdata"]) else _END
    # The names leave a narrow axis, for which the title of the report is too long.
    figure.x_axes(title="|z| (sigma)", nticks=4, range=[0, room * max([*bars["x"], threshold])])
    figure.y_axes(range=[len(bars["y"]) - 0.5, -0.5])
    figure.y_axes(title="candidate", standoff=0, tickfont={"size": 11})
    figure.layout |= {"showlegend": False, "height": HEIGHT, "margin": _SHORT | {"l": 20, "t": 22}}
    return figure


@dataclass(frozen=True)
class Curve:
    """What is drawn of a fit."""

    y: Floats
    """Residuals (sigma), shape (e, 12)."""
    signature: Floats | None = None
    """What the candidate that is looked at would take out of them, shape (e, 12)."""
    name: str = ""


def residuals(fitted: Fitted, curve: Curve, channel: int, stop: int | None, against: str) -> Figure:
    """Residuals of a channel against a variable, with three sigma, what is left out, and a signature.

    They are those of the final coefficients; the heat map has those that the filter met on its way, which knew less.

    `stop`: None shows all stops; `against`: one of `fitted.axes`.
    """
    rows = np.ones(len(fitted.residuals.t), dtype=bool) if stop is None else fitted.residuals.stop == stop
    x, y, out = fitted.axes[against], curve.y[:, channel], fitted.left_out[:, channel]
    used, gone = rows & np.isfinite(y), rows & np.isfinite(out)
    figure = Figure()
    figure.shape("rect", y0=-3.0, y1=3.0, fillcolor=BAND, line={"width": 0}, opacity=1.0, layer="below")
    _points(figure, fitted, used, x, y, "residual", {"color": AFTER, "size": 5})
    if gone.any():
        _points(figure, fitted, gone, x, out, "left out", {"color": BEFORE, "size": 7, "symbol": "x-thin-open"})
    if curve.signature is not None:
        order = np.flatnonzero(used)[np.argsort(x[used], kind="stable")]
        broken = _gaps(x[order], curve.signature[order, channel], against)
        figure.add(
            "scatter",
            x=broken[0],
            y=broken[1],
            mode="lines" if against == TIME else "markers",
            name=f"{literal(curve.name)} would take",
            line={"color": BEFORE, "width": 3},
            hoverinfo="skip",
            marker={"color": BEFORE, "size": 7, "symbol": "diamond"},
        )
    figure.x_axes(title=against)
    figure.y_axes(title="residual (sigma)", zeroline=True, zerolinecolor=PALE)
    more = {"dragmode": "select", "clickmode": "event+select", "margin": _SHORT | {"t": 44}}
    words = _title(curve, fitted, used, channel, stop)
    title = {"text": words, "font": {"size": 13}, "y": 0.98, "yanchor": "top"}
    title |= {"x": 0, "xref": "paper", "xanchor": "left"}
    legend = {"orientation": "h", "x": 1, "xanchor": "right", "y": 1.0, "yanchor": "bottom", "font": {"size": 11}}
    drawn = gone.any() or curve.signature is not None
    return lay_out(figure, HEIGHT, title=title, legend=legend, showlegend=bool(drawn), **more)


def _points(
    figure: Figure, fitted: Fitted, rows: Bools, x: Floats, y: Floats, name: str, marker: dict[str, Any]
) -> None:
    # The span of its epoch goes with each point: what is selected is left out of the fit by its time.
    spans = np.column_stack([fitted.begin[rows], fitted.residuals.t[rows]]).round(3).tolist()
    stops = fitted.residuals.stop[rows].tolist()
    figure.add(
        "scatter",
        x=x[rows],
        y=y[rows],
        mode="markers",
        name=name,
        marker=marker,
        customdata=spans,
        text=stops,
        hovertemplate="stop %{text}, %{customdata[1]:.0f} s<br>%{x:.4g}: %{y:.2f} sigma<extra></extra>",
    )


def _gaps(x: Floats, y: Floats, against: str) -> tuple[Floats, Floats]:
    return data.interrupted(x, y, 5.0) if against == TIME else (x, y)


def _title(curve: Curve, fitted: Fitted, used: Bools, channel: int, stop: int | None) -> str:
    named = f"{CHANNEL_NAMES[channel].replace('_', ' ')} at {'all stops' if stop is None else f'stop {stop}'}"
    y = curve.y[used, channel]
    if not len(y):
        return f"{named}: {'left out' if stop in _left(fitted) else 'not measured'}"
    # The map beside it has the mean over the sigma of a mean: said, as the two numbers differ by the root of the count.
    of = f"mean of {len(y)} points" if len(y) > 1 else "one point"
    return f"{named}: {of} {y.mean():+.2f} sigma".replace("-", "\N{MINUS SIGN}")


def _left(fitted: Fitted) -> set[int]:
    return set(fitted.residuals.stop[np.isfinite(fitted.left_out).any(axis=1)].tolist())


def ladder(
    names: Sequence[str], values: Sequence[float], at_held: Sequence[float | None], use: InUse | None = None
) -> Figure:
    """Error of each fit with one stop left out, and what it is worth in metres.

    `use`: navigations without aid with these models, behind those with none; None until they are worked out.
    """
    worth = [""] * len(names) if use is None else [f", {metres(value)}" for value in use.distance[1 : 1 + len(names)]]
    figure = Figure()
    short = [literal(name if len(name) < 26 else f"{name[:24]}\N{HORIZONTAL ELLIPSIS}") for name in names]
    figure.add(
        "scatter",
        y=short,
        x=list(values),
        mode="lines+markers+text",
        text=[f"{v:.3f}{far}" for v, far in zip(values, worth, strict=True)],
        name="leave one out",
        textposition="middle right",
        line={"color": AFTER},
        marker={"size": 9},
        cliponaxis=False,
        customdata=[literal(name) for name in names],
        hovertemplate="%{customdata}: %{x:.3f} sigma<extra></extra>",
    )
    if any(v is not None for v in at_held):
        figure.add(
            "scatter",
            y=short,
            x=list(at_held),
            mode="markers",
            name="what is left out",
            marker={"symbol": "square-open", "size": 9, "color": BEFORE},
            hovertemplate="left out: %{x:.3f} sigma<extra></extra>",
        )
    figure.shape("line", x0=1.0, x1=1.0, line={"dash": "dash", "color": PALE, "width": 1.5}, opacity=1.0)
    numbers = [v for v in (*values, *at_held, 1.0) if v is not None]
    low, high = min(numbers), max(numbers)
    room = max(0.3 * (high - low), 0.02)
    # A number with metres is twice as wide as one alone.
    beside = 1.4 if use is None else 2.8
    figure.x_axes(title="one stop left out (sigma)", range=[low - 0.3 * room, high + beside * room])
    figure.y_axes(type="category", autorange="reversed", ticks="", automargin=True, title="model", standoff=0)
    return lay_out(figure, HEIGHT, margin=_SHORT | {"l": 20, "r": 40})


def finished(figure: Figure, look: Any) -> Any:
    """Make a figure for the page: in its theme, and larger where it would be too small to read.

    `look`: ``theme``, and ``scale`` of what is written.
    """
    made, scale = figure.as_plotly(str(look.get("theme", "light"))), float(look.get("scale", 1.0))
    if scale == 1.0:
        return made
    margin = {side: value * scale for side, value in made.layout.margin.to_plotly_json().items() if side in "lrtb"}
    made.update_layout(height=made.layout.height * scale, font={"size": _FONT * scale}, margin=margin)
    made.update_layout(hoverlabel_font_size=_FONT * scale)
    if made.layout.title.text:
        made.update_layout(title_font_size=14 * scale)
    made.update_traces(textfont_size=12 * scale, selector={"type": "heatmap"})
    made.update_traces(textfont_size=_BAR_FONT * scale, selector={"mode": "text"})
    made.update_traces(marker_size=8 * scale, selector={"type": "scatter"})
    made.update_annotations(font_size=_FONT * scale)
    made.update_yaxes(tickfont_size=11 * scale)
    made.update_layout(legend_font_size=11 * scale)
    return made
