"""The drawing library as a part of a page: compressed, because it is five times as long as all else."""

from __future__ import annotations

import json
from base64 import b64encode
from functools import cache
from importlib.resources import files
from typing import Any

from sdimu_calibration.report.design.palette import THEMES, palette
from sdimu_calibration.report.design.plotly_template import template

_HERE = files("sdimu_calibration.report.design")
NEEDLESS = ("zoomIn2d", "zoomOut2d", "autoScale2d")
"""Buttons that do what a box and a double click do: without them the others cover less of a figure."""
CONFIG = {
    "responsive": True,
    "displaylogo": False,
    "showSendToCloud": False,
    "modeBarButtonsToRemove": ["lasso2d", "select2d", *NEEDLESS],
}
"""Buttons of a figure: none sends to a server what was measured."""
PRINT = (_HERE / "print.js").read_text(encoding="utf-8")
"""Fits the figures of a page to the sheet while it is printed."""


@cache
def library() -> str:
    """Scripts that draw the figures of a page: plotly.js, brought by requirements/vendored.py, and what starts it."""
    packed = b64encode((_HERE / "plotly.min.js.gz").read_bytes()).decode("ascii")
    values = {
        "FIGURE_COLOURS": {theme: palette(theme) for theme in THEMES},
        "FIGURE_TEMPLATES": {theme: template(theme) for theme in THEMES},
        "FIGURE_CONFIG": CONFIG,
    }
    stated = "".join(f"var {name} = {as_script(value)};" for name, value in values.items())
    draw = (_HERE / "figures.js").read_text(encoding="utf-8")
    return f'<script type="text/plain" id="library">{packed}</script><script>{stated}{draw}{PRINT}</script>'


def as_script(content: Any, default: Any = None) -> str:
    """Content as JSON inside a script; "</" would end the script wherever it stands."""
    return json.dumps(content, default=default, separators=(",", ":")).replace("</", "<\\/")
