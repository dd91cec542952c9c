"""Figures of what was measured against what was predicted, and of what each turn leaves."""

from __future__ import annotations

from typing import Any

import numpy as np
from plotly.subplots import make_subplots

from sdimu_calibration.core.evidence.consistency import CHANNEL_NAMES
from sdimu_calibration.report.drawing import AFTER, BEFORE, lay_out
from sdimu_calibration.report.measured import UNITS, Jumps, Overlay

_LEGEND = {"orientation": "h", "yanchor": "bottom", "y": 1.045, "x": 0}


def overlay(values: Overlay) -> Any:
    """Measured (open squares) and predicted (crosses) of the twelve channels at every stop."""
    figure = make_subplots(
        rows=4, cols=3, subplot_titles=[name.replace("_", " ") for name in CHANNEL_NAMES], shared_xaxes=True,
        vertical_spacing=0.07, horizontal_spacing=0.085,
    )  # fmt: skip
    minutes = values.t / 60.0
    layers = (
        (values.measured, "measured", {"symbol": "square-open", "size": 9, "color": BEFORE, "line": {"width": 1.5}}),
        (values.predicted, "predicted", {"symbol": "x-thin", "size": 6, "color": AFTER,
                                         "line": {"width": 1.8, "color": AFTER}}),
    )  # fmt: skip
    for channel in range(12):
        place = {"row": channel // 3 + 1, "col": channel % 3 + 1}
        for data, name, marker in layers:
            good = np.isfinite(data[:, channel])
            figure.add_scatter(
                x=minutes[good].astype(np.float32), y=data[good, channel].astype(np.float32), mode="markers",
                name=name, legendgroup=name, showlegend=channel == 0, marker=marker,
                hovertemplate=f"%{{x:.1f}} min: %{{y:.5g}} {UNITS[channel]}<extra>{name}</extra>", **place,
            )  # fmt: skip
        figure.update_yaxes(title_text=UNITS[channel], title_standoff=2, **place)
    figure.update_xaxes(title_text="time (min)", row=4)
    figure.update_yaxes(zeroline=True, zerolinecolor="#999", zerolinewidth=1, nticks=6)
    return lay_out(figure, 820, showlegend=True, margin={"l": 65, "r": 20, "t": 95, "b": 55}, legend=_LEGEND)


def jumps(values: Jumps, two: bool) -> Any:
    """Velocity right after each turn against the angle turned, a column a body axis; numbers are stops."""
    figure = make_subplots(
        rows=3, cols=3, shared_xaxes=True, shared_yaxes="rows", vertical_spacing=0.04, horizontal_spacing=0.03,
        subplot_titles=[f"turns about {axis}" for axis in "xyz"],
    )  # fmt: skip
    layers = [(values.before, "model as given", BEFORE, "triangle-up-open")]
    if two:
        layers.append((values.after, "with what was found", AFTER, "circle"))
    for axis in range(3):
        rows = values.axis == axis
        for channel in range(3):
            for data, name, ink, symbol in layers:
                figure.add_scatter(
                    x=values.angle[rows].astype(np.float32), y=data[rows, channel].astype(np.float32), mode="markers",
                    name=name, legendgroup=name, showlegend=axis == 0 and channel == 0, text=values.stop[rows],
                    marker={"color": ink, "symbol": symbol, "size": 8}, row=channel + 1, col=axis + 1,
                    hovertemplate=f"stop %{{text}}, %{{x:.0f}} deg: %{{y:+.1f}} sigma<extra>{name}</extra>",
                )  # fmt: skip
    for channel, letter in enumerate("ned"):
        figure.update_yaxes(title_text=f"velocity {letter}<br>(sigma)", row=channel + 1, col=1)
    figure.update_xaxes(title_text="angle turned (deg)", row=3)
    figure.update_yaxes(zeroline=True, zerolinecolor="#999", zerolinewidth=1)
    figure.update_xaxes(zeroline=True, zerolinecolor="#999", zerolinewidth=1, dtick=90)
    return lay_out(
        figure, 520, showlegend=True, margin={"l": 80, "r": 20, "t": 85, "b": 55},
        legend={**_LEGEND, "y": 1.1},
    )  # fmt: skip
