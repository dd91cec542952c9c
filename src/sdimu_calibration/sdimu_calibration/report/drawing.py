"""What all figures share: ink, signs that do without colour, layout."""

from __future__ import annotations

from typing import Any

BEFORE, AFTER = "#b45f06", "#0b5394"
"""Ink of "model as given" and of "with what was found"."""
BAND = "rgba(0, 0, 0, 0.10)"
PALE = "rgba(90, 90, 90, 0.45)"
DIVERGING = ((0.0, "#2166ac"), (0.25, "#92c5de"), (0.5, "#ffffff"), (0.75, "#f4a582"), (1.0, "#b2182b"))
"""Blue, white, red (C. Brewer's RdBu): also tells signs to those who do not see red and green."""


def lay_out(figure: Any, height: int, **more: Any) -> Any:
    """Give a figure the look of the house."""
    figure.update_layout(
        template="simple_white", height=height, font={"size": 13, "color": "#222"}, hoverlabel={"namelength": -1},
        **{
            "showlegend": False, "margin": {"l": 80, "r": 30, "t": 40, "b": 60},
            "legend": {"orientation": "h", "yanchor": "bottom", "y": 1.02, "x": 0},
            **more,
        },
    )  # fmt: skip
    return figure


CONFIG = {"responsive": True, "displaylogo": False, "modeBarButtonsToRemove": ["lasso2d", "select2d"]}
"""Buttons of a figure."""


def html(figure: Any, number: int) -> str:
    """Return a figure as a part of a page; number 1 brings the library along, so it has to be the first on it."""
    return str(
        figure.to_html(
            full_html=False,
            include_plotlyjs=number == 1,
            div_id=f"figure-{number}",
            config=CONFIG,
        )
    )
