"""What all figures share: ink, signs that do without colour, layout."""

from __future__ import annotations

import json
from typing import Any

from plotly.offline import get_plotlyjs

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


_QUEUE = """
(function () {
  var waiting = [];
  function next() { if (waiting.length) { waiting.shift()(); setTimeout(next, 0); } }
  window.drawLater = function (id, figure, config) {
    waiting.push(function () {
      if (window.innerWidth >= 2400) { figure.layout.font.size = 16; }
      Plotly.newPlot(id, figure.data, figure.layout, config);
    });
  };
  document.addEventListener('DOMContentLoaded', function () { setTimeout(next, 0); });
  window.addEventListener('beforeprint', function () { while (waiting.length) { waiting.shift()(); } });
})();
"""


def html(figure: Any, number: int) -> str:
    """Return a figure as a part of a page; number 1 brings the library along, so it has to be the first on it.

    Figures are drawn one after another once the page is read, so that it opens before the last one is drawn.
    """
    library = f"<script>{get_plotlyjs()}</script><script>{_QUEUE}</script>" if number == 1 else ""
    # "</" would end the script wherever it stands.
    content = str(figure.to_json()).replace("</", "<\\/")
    name, config = f"figure-{number}", json.dumps(CONFIG)
    place = f'<div id="{name}" class="plotly-graph-div" style="height:{figure.layout.height}px; width:100%;"></div>'
    return f'{library}<div>{place}<script>drawLater("{name}", {content}, {config});</script></div>'
