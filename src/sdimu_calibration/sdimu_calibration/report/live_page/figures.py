"""Figures of a running test: sigmas that fall, where it fails, how the error falls; a few thousand numbers each."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sdimu_calibration.report import evidence_figures
from sdimu_calibration.report.data import NOTABLE
from sdimu_calibration.report.design.palette import DIVERGING, SERIES
from sdimu_calibration.report.drawing import MUTED, PALE, Figure, lay_out, literal
from sdimu_calibration.report.groups import title
from sdimu_calibration.report.live_page.curves import Drawn
from sdimu_calibration.report.live_text import Rows, SeenDiagnosis
from sdimu_calibration.report.progress_text import Falling, short

HEIGHT = 300
"""Height of a figure (px): two of them and the bar stand on a screen of 900."""
_MAP, _SMALL_MAP = 320, 170
"""Heights of the maps of twelve and of four channels (px)."""
_EMPTY = 110
"""Height of a figure that has nothing to show yet (px)."""
_CELL = 10
"""Size of the numbers in cells (px)."""
_MOST_NUMBERED, _MOST_WHOLE = 12, 26
"""Number of stops up to which numbers with a digit, and whole numbers, stand beside each other in a column."""
_DIGITS = 4
"""Digits of what is drawn: finer than a screen, and short on the way to the page."""
_FULL = 3.0
"""Powers of two of the NIS at which the colour is full: eight times too large."""
_DASHES = ("solid", "dash", "dot", "dashdot")
_THICK = 2
"""What a line is thicker (px) where its dash comes a second time: of long dashes nobody tells which is which."""
_FONT = {"size": 12}
_KEPT = "kept"
"""Name under which plotly keeps what a person zoomed, while a figure grows."""
_MARGIN = {"l": 60, "r": 14, "t": 10, "b": 44}
_LEGEND = {"orientation": "h", "x": 0, "y": -0.26, "yanchor": "top", "font": _FONT}
_ENTRY = 150
"""Width of the words of an entry of the legend (px), its size below its name: two stand beside each other in a column
of 470."""
_LABELS = 14
"""Number of stops that are written below a map: more would touch each other, or be turned on their side."""
_SENSORS = ("gyro", "accel")


def sigmas(curves: Drawn, fallen: Sequence[Falling]) -> Figure:
    """Draw what is left of the sigmas of each effect, over the test, on a logarithmic scale.

    `curves`: share of the sigma at the start, by effect; `fallen`: the same now, with the sizes that the legend tells.
    """
    now = {f.effect: f"<br>{short(f.sigma)} {f.unit}" for f in fallen}
    minutes = [round(t / 60.0, _DIGITS) for t in curves.t]
    seen = dict.fromkeys(("gyro", "accel", "other"), 0)
    figure = Figure()
    for effect, values in curves.values.items():
        triad = next((word for word in _SENSORS if effect.startswith(word)), "other")
        again, dash = divmod(seen[triad], len(_DASHES))
        seen[triad] += 1
        figure.add(
            "scatter",
            x=minutes,
            y=[None if v is None else float(f"{v:.{_DIGITS}g}") for v in values],
            mode="lines",
            name=literal(title(effect)) + now.get(effect, ""),
            line={
                "color": MUTED if triad == "other" else f"@{triad}",
                "dash": _DASHES[dash],
                "width": 2 + _THICK * again,
            },
            hovertemplate=f"{literal(title(effect))}: %{{y:.2g}} of its sigma at the start<extra></extra>",
        )
    figure.x_axes(title="time of the test (min)", rangemode="tozero", standoff=4)
    figure.y_axes(title="sigma, share of the start", type="log", dtick="D2", tickformat=".2~%", standoff=4)
    legend = _LEGEND | {"x": -0.2, "y": -0.24, "entrywidth": _ENTRY}
    more = {"showlegend": True, "legend": legend, "margin": _MARGIN | {"b": 184}, "uirevision": _KEPT}
    return _laid_out(figure, HEIGHT + 120, **more)


def nis_map(nis: Sequence[tuple[int, Mapping[str, float]]]) -> Figure:
    """Draw how large the innovations of each stop are beside what was promised; 1 is right."""
    channels = list(dict.fromkeys(channel for _, values in nis for channel in values))
    value = np.array([[values.get(channel, math.nan) for _, values in nis] for channel in channels])
    # Of three degrees of freedom, as a stop has them in position, a tenth is nothing unusual and ten is.
    tint = np.where(value > 1.0, np.log2(np.maximum(value, 1.0)), value - 1.0)
    numbered = len(nis) <= _MOST_WHOLE
    text = [[_ratio(v) if numbered else "" for v in row] for row in value.tolist()]
    figure = Figure()
    figure.add(
        "heatmap",
        x=[str(stop) for stop, _ in nis],
        y=channels,
        z=tint,
        customdata=value,
        text=text,
        texttemplate="%{text}",
        textfont={"size": _CELL},
        zmin=-_FULL,
        zmax=_FULL,
        colorscale=list(DIVERGING),
        xgap=2,
        ygap=2,
        showscale=False,
        hovertemplate="%{y} at stop %{x}: NIS %{customdata:.2f}<extra></extra>",
    )
    return _by_stop(figure, _SMALL_MAP)


def _ratio(value: float) -> str:
    if not math.isfinite(value):
        return ""
    return f"{value:.0f}" if value >= 9.95 else f"{value:.1f}"


def heat_map(seen: SeenDiagnosis) -> Figure:
    """Draw the mean innovation of every channel at every stop, over its sigma."""
    figure = evidence_figures.deviates(seen.stops, seen.channels, seen.heat, "stop", "channel", _MAP)
    if len(seen.stops) > _MOST_NUMBERED:
        write = _whole if len(seen.stops) <= _MOST_WHOLE else evidence_figures.sign
        figure.data[0]["text"] = [[write(v) for v in row] for row in seen.heat.tolist()]
    figure.data[0] |= {"showscale": False, "textfont": {"size": _CELL}}
    return _by_stop(figure, _MAP)


def _whole(value: float) -> str:
    """Write what stands out as a whole number."""
    return f"{value:+.0f}".replace("-", "\N{MINUS SIGN}") if abs(value) > NOTABLE else ""


def _by_stop(figure: Figure, height: int) -> Figure:
    every = math.ceil(len(figure.data[0]["x"]) / _LABELS)
    figure.x_axes(title="stop", type="category", showgrid=False, ticks="", tickangle=0, dtick=every, standoff=2)
    figure.y_axes(autorange="reversed", ticks="", automargin=True, title="")
    return _laid_out(figure, height, margin=_MARGIN | {"l": 70, "b": 40})


def errors(found: Sequence[tuple[int, Rows]]) -> Figure:
    """Draw the error of each model with one stop left out, by the stop that the test had reached."""
    names = list(dict.fromkeys(name for _, rows in found for name, _ in rows))
    figure = Figure()
    for k, name in enumerate(names):
        points = [(stop, _number(dict(rows).get(name, ""))) for stop, rows in found]
        known = [(stop, value) for stop, value in points if value is not None]
        ink = SERIES[(k + 3) % len(SERIES)]
        figure.add(
            "scatter",
            x=[stop for stop, _ in known],
            y=[value for _, value in known],
            mode="lines+markers",
            name=literal(f"{name} {known[-1][1]:.3g}") if known else literal(name),
            line={"color": ink, "dash": _DASHES[k % len(_DASHES)]},
            marker={"size": 7, "color": ink},
            hovertemplate=f"{literal(name)}, up to stop %{{x}}: %{{y:.3f}} sigma<extra></extra>",
        )
    figure.shape("line", y0=1.0, y1=1.0, line={"dash": "dash", "color": PALE, "width": 1.5}, opacity=1.0)
    largest = max((point for trace in figure.data for point in trace["y"]), default=1.0)
    scale = "log" if largest > 10.0 else "linear"
    figure.x_axes(title="up to stop", dtick=1 if len(found) < 10 else None, standoff=4)
    figure.y_axes(title="one stop left out (sigma)", standoff=4, type=scale)
    more = {"showlegend": True, "legend": _LEGEND, "margin": _MARGIN | {"b": 84}, "uirevision": _KEPT}
    return _laid_out(figure, HEIGHT, **more)


def nothing(words: str) -> Figure:
    """Say why there is no figure yet."""
    figure = Figure()
    figure.annotate(words, x=0.5, y=0.5, xref="paper", yref="paper", font={"color": MUTED, "size": 13})
    figure.x_axes(visible=False)
    figure.y_axes(visible=False)
    return _laid_out(figure, _EMPTY, margin=_MARGIN)


def _number(text: str) -> float | None:
    """Read the error of a model; None where it is not known yet."""
    try:
        return float(text)
    except ValueError:
        return None


def _laid_out(figure: Figure, height: int, **more: Any) -> Figure:
    return lay_out(figure, height, **{"font": _FONT, **more})


def finished(figure: Figure, look: Any) -> Any:
    """Make a figure for the page: in its theme, and all of it larger on a screen of many pixels.

    `look`: ``theme``, and ``scale`` of what is written.
    """
    scale = float(look.get("scale", 1.0))
    if scale != 1.0:
        figure.layout["height"] *= scale
        figure.layout["font"] = {"size": 12 * scale}
        figure.layout["margin"] = {side: value * scale for side, value in figure.layout["margin"].items()}
        legend = figure.layout["legend"]
        figure.layout["legend"] = legend | {"font": {"size": 12 * scale}}
        if "entrywidth" in legend:
            figure.layout["legend"]["entrywidth"] = legend["entrywidth"] * scale
        for trace in figure.data:
            if "textfont" in trace:
                trace["textfont"] = {"size": trace["textfont"]["size"] * scale}
    return figure.content(str(look.get("theme", "light")))
