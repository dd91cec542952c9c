"""Figure and page of the mount study: error of each estimator against mount misalignment."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.groups import title
from sdimu_calibration.report.style import STYLE

_DASHES = ("solid", "dash", "dot")
_COLOURS = ("#0b5394", "#b45f06", "#38761d")
_COLUMNS = 2


def figure(content: Mapping[str, Any], units: Mapping[str, str]) -> Any:
    """Draw RMS error against mount, one panel an effect, logarithmic; `units` are the display units by effect."""
    effects = list(units)
    rows = -(-len(effects) // _COLUMNS)
    drawn = make_subplots(
        rows=rows, cols=_COLUMNS, subplot_titles=[title(effect) for effect in effects], vertical_spacing=0.09
    )
    mounts = np.asarray(content["mount_deg"], dtype=float)
    for panel, effect in enumerate(effects):
        place = {"row": panel // _COLUMNS + 1, "col": panel % _COLUMNS + 1}
        for order, (estimator, by_effect) in enumerate(content["rms"].items()):
            factor = from_si(1.0, units[effect])
            drawn.add_trace(
                go.Scatter(
                    x=mounts, y=np.asarray(by_effect[effect]) * factor, mode="lines+markers", name=estimator,
                    legendgroup=estimator, showlegend=panel == 0,
                    error_y={"type": "data", "array": np.asarray(content["spread"][estimator][effect]) * factor},
                    line={"color": _COLOURS[order % 3], "dash": _DASHES[order % 3]},
                ),
                **place,
            )  # fmt: skip
        drawn.update_yaxes(type="log", dtick=1, exponentformat="power", title_text=f"RMS ({units[effect]})", **place)
        drawn.update_xaxes(title_text="mount (deg)" if panel >= len(effects) - _COLUMNS else None, **place)
    drawn.update_layout(
        template="simple_white", height=260 * rows + 80, font={"size": 12, "color": "#222"},
        legend={"orientation": "h", "y": 1.06}, margin={"l": 70, "r": 30, "t": 60, "b": 50},
    )  # fmt: skip
    return drawn


def write_page(path: Path, content: Mapping[str, Any], units: Mapping[str, str]) -> None:
    """Write the page: one file that needs no network."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    drawn = figure(content, units).to_html(full_html=False, include_plotlyjs=True, config={"responsive": True})
    text = (
        f"{len(content['seeds'])} IMUs, each tested at every mount (the same angle about all axes). RMS over IMUs "
        "and axes; bars: its standard error. The classical estimator takes table axes for IMU axes. Turned into the "
        "accelerometers' own frame afterwards it loses most of the mount again: on a table whose angles are perfect."
    )
    heading = "Error against mount misalignment"
    page = (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{heading}</title>'
        f'<style>{STYLE}</style></head><body>\n<h1>{heading}</h1><p class="quiet">{escape(text)}</p>'
        f"{drawn}\n</body></html>\n"
    )
    temporary = path.with_name(f".{path.name}.part")
    temporary.write_text(page, encoding="utf-8")
    temporary.replace(path)
