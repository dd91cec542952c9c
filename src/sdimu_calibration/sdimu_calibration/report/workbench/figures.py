"""Figures that only the workbench has: one stop of one channel in time, the ladder of fits; and their sizes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from sdimu_calibration.core.evidence.consistency import CHANNEL_NAMES
from sdimu_calibration.report import data, evidence_figures
from sdimu_calibration.report.drawing import AFTER, BAND, BEFORE, INK, MUTED, Figure, lay_out

_FONT = 13


def heat_map(grid: data.Grid, cell: tuple[int, int]) -> Any:
    """Heat map of the report with a frame around the cell that is looked at."""
    figure = evidence_figures.heat_map(grid)
    row, column = cell[0], int(np.searchsorted(grid.stops, cell[1]))
    figure.shape(
        "rect", x0=column - 0.5, x1=column + 0.5, y0=row - 0.5, y1=row + 0.5, fillcolor="rgba(0, 0, 0, 0)",
        line={"color": INK, "width": 3},
    )  # fmt: skip
    return figure.as_plotly()


def ranking(entries: Sequence[data.Scored], threshold: float) -> Any:
    """Ranking of the report, with room for the numbers at the ends of the bars."""
    figure = evidence_figures.ranking(entries, threshold)
    top = max([abs(e.z) for e in entries] + [threshold])
    figure.x_axes(range=[0, 1.85 * top])
    figure.layout["showlegend"] = False
    return figure.as_plotly()


def cell(found: data.Residuals, grid: data.Grid, channel: int, stop: int) -> Any:
    """Innovations of a channel at a stop against time, with three sigma and their mean.

    They are those of the final coefficients; the heat map has those that the filter met on its way, which knew less.
    """
    rows = (found.stop == stop) & np.isfinite(found.before[:, channel])
    t, y = found.t[rows], found.before[rows, channel]
    figure = Figure()
    figure.shape("rect", y0=-3.0, y1=3.0, fillcolor=BAND, line={"width": 0}, opacity=1.0, layer="below")
    marker = {"color": AFTER, "size": 5}
    hover = "%{x:.0f} s: %{y:.2f}<extra></extra>"
    figure.add("scatter", x=t, y=y, mode="markers", marker=marker, hovertemplate=hover)
    if len(y):
        mean = float(y.mean())
        figure.shape("line", y0=mean, y1=mean, line={"color": BEFORE, "width": 2, "dash": "dash"}, opacity=1.0)
    figure.x_axes(title="time (s)")
    figure.y_axes(title="innovation (sigma)", zeroline=True, zerolinecolor=MUTED)
    met = grid.value[channel, grid.stops == stop]
    told = f"{met[0]:+.1f} sigma on the way (above); " if np.isfinite(met).any() else ""
    said = f"{told}with the final coefficients mean {y.mean():+.2f} sigma (dashed)" if len(y) else "not measured"
    named = f"{CHANNEL_NAMES[channel].replace('_', ' ')} at stop {stop}: {said}".replace("-", "\N{MINUS SIGN}")
    return lay_out(figure, 280, title={"text": named, "font": {"size": 14}}).as_plotly()


def ladder(names: Sequence[str], values: Sequence[float], at_held: Sequence[float | None]) -> Any:
    """Held-out RMS of each fit; one is right."""
    figure = Figure()
    figure.add(
        "scatter", x=list(names), y=list(values), mode="lines+markers+text", text=[f"{v:.3f}" for v in values],
        name="leave one out", textposition="top center", line={"color": AFTER}, marker={"size": 9}, cliponaxis=False,
    )  # fmt: skip
    if any(v is not None for v in at_held):
        figure.add(
            "scatter", x=list(names), y=list(at_held), mode="markers+lines", name="stops held out",
            line={"color": BEFORE, "dash": "dot"}, marker={"symbol": "square-open", "size": 9},
        )  # fmt: skip
    figure.shape("line", y0=1.0, y1=1.0, line={"dash": "dash", "color": INK, "width": 1.5}, opacity=1.0)
    figure.annotate("1 is right", x=0, xref="x domain", y=1.0, xanchor="left", yanchor="top")
    top = max([*values, *(v for v in at_held if v is not None), 1.0])
    figure.y_axes(title="held-out RMS (sigma)", range=[0, 1.25 * top])
    figure.x_axes(type="category", title="model, rung by rung")
    return lay_out(figure, 320, showlegend=True).as_plotly()


def enlarged(figure: Any, scale: float) -> Any:
    """Make a figure larger, writing and all, for screens on which it would be too small to read."""
    if scale == 1.0:
        return figure
    margin = {side: value * scale for side, value in figure.layout.margin.to_plotly_json().items() if side in "lrtb"}
    figure.update_layout(height=figure.layout.height * scale, font={"size": _FONT * scale}, margin=margin)
    figure.update_layout(hoverlabel_font_size=_FONT * scale)
    if figure.layout.title.text:
        figure.update_layout(title_font_size=14 * scale)
    figure.update_traces(textfont_size=12 * scale, selector={"type": "heatmap"})
    figure.update_traces(marker_size=8 * scale, selector={"type": "scatter"})
    figure.update_annotations(font_size=_FONT * scale)
    return figure
