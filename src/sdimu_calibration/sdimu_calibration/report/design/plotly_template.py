"""Templates of figures in light and dark, made from the tokens of the pages."""

from __future__ import annotations

from typing import Any

from sdimu_calibration.report.design.palette import DIVERGING, SERIES, paint

FONT = "system-ui, -apple-system, 'Segoe UI', 'Noto Sans', sans-serif"


def template(theme: str) -> dict[str, Any]:
    """Template of plotly for a theme: transparent paper, thin axes with ticks outside, quiet grid."""
    axis = {
        "automargin": True,
        "gridcolor": "@grid",
        "showgrid": True,
        "linecolor": "@muted",
        "showline": True,
        "ticks": "outside",
        "tickcolor": "@muted",
        "ticklen": 4,
        "zeroline": False,
        "zerolinecolor": "@muted",
        "title": {"standoff": 12},
    }
    scene = {"backgroundcolor": "@card", "gridcolor": "@grid", "linecolor": "@muted", "zerolinecolor": "@line"}
    bar = {"outlinewidth": 0, "ticks": "outside", "tickcolor": "@muted", "thickness": 12}
    layout = {
        "autotypenumbers": "strict",
        "colorway": list(SERIES),
        "font": {"family": FONT, "color": "@ink", "size": 13},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "hovermode": "closest",
        "hoverlabel": {"align": "left", "bgcolor": "@card", "bordercolor": "@muted", "font": {"color": "@ink"}},
        "modebar": {"color": "@muted", "activecolor": "@ink", "bgcolor": "rgba(0,0,0,0)"},
        "xaxis": axis,
        "yaxis": axis,
        "scene": {f"{letter}axis": scene for letter in "xyz"},
        "colorscale": {"diverging": list(DIVERGING)},
        "legend": {"bgcolor": "rgba(0,0,0,0)"},
    }
    data = {
        "heatmap": [{"type": "heatmap", "colorbar": bar, "colorscale": list(DIVERGING)}],
        "bar": [{"type": "bar", "error_x": {"color": "@ink"}, "error_y": {"color": "@ink"}}],
    }
    return dict(paint({"layout": layout, "data": data}, theme))
