"""Figures of what was measured against what was predicted, and of what each turn leaves."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.evidence.consistency import CHANNEL_NAMES
from sdimu_calibration.report.drawing import AFTER, BEFORE, MUTED, Figure, lay_out
from sdimu_calibration.report.measured import UNITS, Jumps, Overlay

_LEGEND = {"orientation": "h", "yanchor": "bottom", "y": 1.045, "x": 0}


def overlay(values: Overlay) -> Figure:
    """Measured (open squares) and predicted (crosses) of the twelve channels at every stop."""
    figure = Figure(
        rows=4, cols=3, titles=[name.replace("_", " ") for name in CHANNEL_NAMES], share_x=True, gap_y=0.07, gap_x=0.085
    )
    minutes = values.t / 60.0
    layers = (
        (values.measured, "measured", {"symbol": "square-open", "size": 9, "color": BEFORE, "line": {"width": 1.5}}),
        (
            values.predicted,
            "predicted",
            {"symbol": "x-thin", "size": 6, "color": AFTER, "line": {"width": 1.8, "color": AFTER}},
        ),
    )
    for channel in range(12):
        place = {"row": channel // 3 + 1, "col": channel % 3 + 1}
        for data, name, marker in layers:
            good = np.isfinite(data[:, channel])
            figure.add(
                "scatter",
                x=minutes[good],
                y=data[good, channel],
                mode="markers",
                name=name,
                legendgroup=name,
                showlegend=channel == 0,
                marker=marker,
                hovertemplate=f"%{{x:.1f}} min: %{{y:.5g}} {UNITS[channel]}<extra>{name}</extra>",
                **place,
            )
        figure.y_axes(title=UNITS[channel], standoff=2, row=place["row"], col=1)
    figure.x_axes(title="time (min)", row=4)
    figure.y_axes(zeroline=True, zerolinecolor=MUTED, zerolinewidth=1, nticks=6)
    return lay_out(figure, 820, showlegend=True, margin={"l": 65, "r": 20, "t": 95, "b": 55}, legend=_LEGEND)


def jumps(values: Jumps, two: bool) -> Figure:
    """Velocity right after each turn against the angle turned, a column a body axis; numbers are stops."""
    figure = Figure(
        rows=3,
        cols=3,
        share_x=True,
        share_y=True,
        gap_y=0.04,
        gap_x=0.03,
        titles=[f"turns about {axis}" for axis in "xyz"],
    )
    layers = [(values.before, "model as given", BEFORE, "triangle-up-open")]
    if two:
        layers.append((values.after, "with what was found", AFTER, "circle"))
    for axis in range(3):
        rows = values.axis == axis
        for channel in range(3):
            for data, name, ink, symbol in layers:
                figure.add(
                    "scatter",
                    x=values.angle[rows],
                    y=data[rows, channel],
                    mode="markers",
                    name=name,
                    legendgroup=name,
                    showlegend=axis == 0 and channel == 0,
                    text=values.stop[rows],
                    marker={"color": ink, "symbol": symbol, "size": 8},
                    row=channel + 1,
                    col=axis + 1,
                    hovertemplate=f"stop %{{text}}, %{{x:.0f}} deg: %{{y:+.1f}} sigma<extra>{name}</extra>",
                )
    for channel, letter in enumerate("ned"):
        figure.y_axes(title=f"velocity {letter}<br>(sigma)", row=channel + 1, col=1)
    figure.x_axes(title="angle turned (deg)", row=3)
    figure.y_axes(zeroline=True, zerolinecolor=MUTED, zerolinewidth=1)
    figure.x_axes(zeroline=True, zerolinecolor=MUTED, zerolinewidth=1, dtick=90)
    return lay_out(
        figure, 520, showlegend=True, margin={"l": 80, "r": 20, "t": 85, "b": 55}, legend={**_LEGEND, "y": 1.1}
    )
