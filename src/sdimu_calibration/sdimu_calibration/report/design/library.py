"""The drawing library as a part of a page: compressed, because it is five times as long as all else."""

from __future__ import annotations

import gzip
import json
from base64 import b64encode
from functools import cache
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from sdimu_calibration.report.design.palette import THEMES, palette
from sdimu_calibration.report.design.plotly_template import template

_HERE = files("sdimu_calibration.report.design")
CONFIG = {"responsive": True, "displaylogo": False, "modeBarButtonsToRemove": ["lasso2d", "select2d"]}
"""Buttons of a figure."""
PRINT = (_HERE / "print.js").read_text(encoding="utf-8")
"""Fits the figures of a page to the sheet while it is printed."""
_LEVEL = 5
"""Level of compression (1): 1 % larger than the highest level, in half the time."""


@cache
def library() -> str:
    """Scripts that draw the figures of a page; found without loading the Python package, which takes long.

    Raises
    ------
    ModuleNotFoundError
        When plotly is not installed.
    """
    spec = find_spec("plotly")
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError("figures need the Python package plotly: pip install plotly", name="plotly")
    script = (Path(spec.origin).parent / "package_data" / "plotly.min.js").read_bytes()
    packed = b64encode(gzip.compress(script, _LEVEL, mtime=0)).decode("ascii")
    values = {
        "FIGURE_COLOURS": {theme: palette(theme) for theme in THEMES},
        "FIGURE_TEMPLATES": {theme: template(theme) for theme in THEMES}, "FIGURE_CONFIG": CONFIG,
    }  # fmt: skip
    stated = "".join(f"var {name} = {as_script(value)};" for name, value in values.items())
    draw = (_HERE / "figures.js").read_text(encoding="utf-8")
    return f'<script type="text/plain" id="library">{packed}</script><script>{stated}{draw}{PRINT}</script>'


def as_script(content: Any, default: Any = None) -> str:
    """Content as JSON inside a script; "</" would end the script wherever it stands."""
    return json.dumps(content, default=default, separators=(",", ":")).replace("</", "<\\/")
