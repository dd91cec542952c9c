"""Figures of a calibration, legible in print and without colour."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.results import Calibration, History
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.groups import groups, is_free, short_name, title

_COLOURS = ("#0b5394", "#b45f06", "#38761d", "#741b47", "#134f5c", "#7f6000")
_DASHES = ("solid", "dash", "dot", "dashdot", "longdash", "longdashdot")
_BAND = "rgba(0, 0, 0, 0.10)"
_COLUMNS = 2
_PANEL_HEIGHT = 260
_GAP = 75
_LABEL_GAP = 0.075
"""Least distance of two labels, as a share of a panel's height."""
_MOST_POINTS = 700


def sigma_history(calibration: Calibration) -> Any:
    """Sigma of every coefficient against time (as Fig. 3.1 of Kim, Song & Lyou), one panel an effect.

    Grey bands are rotations. A coefficient that the body frame makes zero by definition has no line.

    Parameters
    ----------
    calibration : Calibration

    Returns
    -------
    plotly.graph_objects.Figure
    """
    history = calibration.history
    panels = groups(calibration.names, calibration.model)
    rows = -(-len(panels) // _COLUMNS)
    figure = make_subplots(
        rows=rows,
        cols=_COLUMNS,
        subplot_titles=[title(effect) for effect in panels],
        vertical_spacing=min(_GAP / (_PANEL_HEIGHT * rows), 1.0 / max(rows - 1, 1)),
        horizontal_spacing=0.12,
    )
    kept = _thin(history)
    for panel, (effect, indices) in enumerate(panels.items()):
        row, column = panel // _COLUMNS + 1, panel % _COLUMNS + 1
        unit = calibration.display_units[indices[0]]
        labels = _draw(figure, calibration, effect, indices, kept, (row, column))
        _label(figure, labels, float(history.t[-1]) / 60.0, (row, column))
        figure.update_yaxes(
            title_text=f"sigma ({unit})", type="log", dtick=1, exponentformat="power", row=row, col=column
        )
        figure.update_xaxes(
            title_text="time (min)",
            title_standoff=2,
            range=[0, float(history.t[-1]) / 60.0],
            row=row,
            col=column,
        )
    _bands(figure, history, len(panels))
    figure.update_layout(
        template="simple_white",
        height=_PANEL_HEIGHT * rows + 60,
        showlegend=False,
        margin={"l": 70, "r": 50, "t": 40, "b": 50},
        font={"size": 12, "color": "#222"},
        hovermode="x",
    )
    return figure


def _draw(
    figure: Any,
    calibration: Calibration,
    effect: str,
    indices: list[int],
    kept: Ints,
    place: tuple[int, int],
) -> dict[str, float]:
    """Draw the lines of one panel; return the last sigma by label."""
    history = calibration.history
    labels: dict[str, float] = {}
    for order, index in enumerate(indices):
        unit = calibration.display_units[index]
        sigma = history.sigma[kept, index] * from_si(1.0, unit)
        if not is_free(calibration, index):
            continue
        name = short_name(calibration.names[index], effect)
        labels[name] = float(sigma[-1])
        line = go.Scatter(
            x=(history.t[kept] / 60.0).astype(np.float32),
            y=np.where(sigma > 0, sigma, np.nan).astype(np.float32),
            mode="lines",
            name=calibration.names[index],
            line={"color": _COLOURS[order % 6], "dash": _DASHES[order % 6], "width": 1.6},
            hovertemplate=f"%{{y:.3g}} {unit}",
        )
        figure.add_trace(line, row=place[0], col=place[1])
    return labels


def _label(figure: Any, labels: dict[str, float], end_min: float, place: tuple[int, int]) -> None:
    """Write the names at the ends of their lines, pushed apart where lines end together."""
    if not labels:
        return
    drawn = list(figure.select_traces(row=place[0], col=place[1]))
    everything = np.concatenate([np.log10(np.asarray(trace.y, float)) for trace in drawn])
    gap = _LABEL_GAP * max(float(np.nanmax(everything) - np.nanmin(everything)), 0.5)
    heights = spread(np.log10(list(labels.values())), gap)
    for order, (name, height) in enumerate(zip(labels, heights, strict=True)):
        figure.add_annotation(
            x=end_min,
            y=float(height),
            text=name,
            showarrow=False,
            xanchor="left",
            xshift=4,
            font={"size": 11, "color": drawn[order].line.color},
            row=place[0],
            col=place[1],
        )


def spread(heights: Floats, gap: float) -> Floats:
    """Push numbers apart until neighbours are `gap` apart, keeping their order and their mean.

    Parameters
    ----------
    heights : ndarray, shape (k,)
    gap : float

    Returns
    -------
    ndarray, shape (k,)
    """
    order = np.argsort(heights, kind="stable")
    # Least squares under "neighbours at least `gap` apart" is isotonic regression of heights - gap * rank: pool
    # neighbours that fall (pool adjacent violators; Ayer et al. 1955).
    pools: list[tuple[float, int]] = []
    for rank, height in enumerate(np.asarray(heights, float)[order]):
        total, count = float(height) - gap * rank, 1
        while pools and pools[-1][0] / pools[-1][1] > total / count:
            before, members = pools.pop()
            total, count = total + before, count + members
        pools.append((total, count))
    level = np.repeat([total / count for total, count in pools], [count for _, count in pools])
    result = np.empty(len(order))
    result[order] = level + gap * np.arange(len(order))
    return result


def rotations(history: History) -> list[tuple[float, float]]:
    """Spans (s) in which the table turns."""
    turning = np.concatenate([[False], ~history.dwell, [False]])
    edges = np.flatnonzero(turning[1:] != turning[:-1])
    before = np.concatenate([[0.0], history.t])
    return [(float(before[a]), float(before[b])) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _bands(figure: Any, history: History, panels: int) -> None:
    """Grey bands over the rotations, set at once: adding shapes one by one is quadratic in plotly."""
    shapes = [
        {
            "type": "rect",
            "xref": f"x{panel + 1 if panel else ''}",
            "yref": f"y{panel + 1 if panel else ''} domain",
            "x0": start / 60.0,
            "x1": end / 60.0,
            "y0": 0,
            "y1": 1,
            "fillcolor": _BAND,
            "line": {"width": 0},
            "layer": "below",
        }
        for panel in range(panels)
        for start, end in rotations(history)
    ]
    figure.update_layout(shapes=shapes)


def _thin(history: History) -> Ints:
    """Choose the rows to draw: evenly, with the last, so that the page stays small."""
    m = len(history.t)
    return np.unique(np.linspace(0, m - 1, min(m, _MOST_POINTS)).astype(np.int64))
