"""Figures that only the workbench has: one stop of one channel in time, and the ladder of fits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go

from sdimu_calibration.core.diagnosis.consistency import CHANNEL_NAMES
from sdimu_calibration.report import data
from sdimu_calibration.report.drawing import AFTER, BAND, BEFORE, lay_out


def cell(found: data.Residuals, channel: int, stop: int) -> Any:
    """Innovations of a channel at a stop against time, with three sigma and their mean."""
    rows = (found.stop == stop) & np.isfinite(found.before[:, channel])
    t, y = found.t[rows], found.before[rows, channel]
    figure = go.Figure()
    figure.add_hrect(y0=-3.0, y1=3.0, fillcolor=BAND, opacity=1.0, line_width=0, layer="below")
    marker = {"color": AFTER, "size": 5}
    figure.add_scatter(x=t, y=y, mode="markers", marker=marker, hovertemplate="%{x:.0f} s: %{y:.2f}")
    if len(y):
        figure.add_hline(y=float(y.mean()), line={"color": BEFORE, "width": 2, "dash": "dash"}, opacity=1.0)
    figure.update_xaxes(title_text="time (s)")
    figure.update_yaxes(title_text="innovation (sigma)", zeroline=True, zerolinecolor="#999")
    mean = f"mean {y.mean():+.2f}" if len(y) else "not measured"
    named = f"{CHANNEL_NAMES[channel].replace('_', ' ')} at stop {stop}: {mean}"
    return lay_out(figure, 280, title={"text": named, "font": {"size": 14}})


def ladder(names: Sequence[str], values: Sequence[float], at_held: Sequence[float | None]) -> Any:
    """Held-out RMS of each fit; one is right."""
    figure = go.Figure()
    figure.add_scatter(
        x=list(names), y=list(values), mode="lines+markers+text", text=[f"{v:.3f}" for v in values],
        name="leave one out", textposition="top right", line={"color": AFTER}, marker={"size": 9}, cliponaxis=False,
    )  # fmt: skip
    if any(v is not None for v in at_held):
        figure.add_scatter(
            x=list(names), y=list(at_held), mode="markers+lines", name="stops held out",
            line={"color": BEFORE, "dash": "dot"}, marker={"symbol": "square-open", "size": 9},
        )  # fmt: skip
    figure.add_hline(y=1.0, line={"dash": "dash", "color": "#222", "width": 1.5}, opacity=1.0)
    top = max([*values, *(v for v in at_held if v is not None), 1.0])
    figure.update_yaxes(title_text="held-out RMS (sigma)", range=[0, 1.25 * top])
    figure.update_xaxes(type="category")
    return lay_out(figure, 300, showlegend=True)
