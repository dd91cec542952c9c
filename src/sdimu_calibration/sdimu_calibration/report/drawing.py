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
  var waiting = [], LARGE = 1.5;
  function next() { if (waiting.length) { waiting.shift()(); setTimeout(next, 0); } }
  // Figures count in pixels: on a screen of 4K all that is written, and the room for it, is made larger.
  function enlarge(part, by) {
    Object.keys(part).forEach(function (key) {
      var value = part[key];
      if (!value || typeof value !== 'object' || key === 'template' || typeof value[0] === 'number') { return; }
      if (/font$|^marker$/.test(key) && typeof value.size === 'number') { value.size *= by; }
      enlarge(value, by);
    });
  }
  function forLargeScreen(id, figure) {
    enlarge(figure, LARGE);
    var margin = figure.layout.margin;
    Object.keys(margin).forEach(function (side) { margin[side] *= LARGE; });
    figure.layout.height *= LARGE;
    document.getElementById(id).style.height = figure.layout.height + 'px';
  }
  window.drawLater = function (id, figure, config) {
    waiting.push(function () {
      if (window.innerWidth >= 2400) { forLargeScreen(id, figure); }
      Plotly.newPlot(id, figure.data, figure.layout, config);
    });
  };
  document.addEventListener('DOMContentLoaded', function () { setTimeout(next, 0); });
  window.addEventListener('beforeprint', function () { while (waiting.length) { waiting.shift()(); } });
})();
"""

PRINT = """
(function () {
  function figures() { return document.querySelectorAll('.js-plotly-plot'); }
  window.addEventListener('beforeprint', function () {
    figures().forEach(function (f) {
      // The sheet shows figures at 68 %, so that the tallest fits on a page; at less what a large screen has larger.
      var share = 0.68 * 13 / f._fullLayout.font.size;
      Plotly.relayout(f, {width: 680 / share, autosize: false});
      f.parentNode.style.height = share * f._fullLayout.height + 'px';
      f.querySelector('.plot-container').style.zoom = share;
    });
  });
  window.addEventListener('afterprint', function () {
    figures().forEach(function (f) {
      f.parentNode.style.height = '';
      f.querySelector('.plot-container').style.zoom = '';
      Plotly.relayout(f, {width: null, autosize: true});
    });
  });
})();
"""
"""Fits the figures of a page to the sheet while it is printed."""


def html(figure: Any, number: int) -> str:
    """Return a figure as a part of a page; number 1 brings the library along, so it has to be the first on it.

    Figures are drawn one after another once the page is read, so that it opens before the last one is drawn.
    """
    library = f"<script>{get_plotlyjs()}</script><script>{_QUEUE}{PRINT}</script>" if number == 1 else ""
    # "</" would end the script wherever it stands.
    content = str(figure.to_json()).replace("</", "<\\/")
    name, config = f"figure-{number}", json.dumps(CONFIG)
    place = f'<div id="{name}" class="plotly-graph-div" style="height:{figure.layout.height}px; width:100%;"></div>'
    return f'{library}<div>{place}<script>drawLater("{name}", {content}, {config});</script></div>'
