"""Figure and page of the mount study: error of each estimator against mount misalignment."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.design.palette import SERIES
from sdimu_calibration.report.design.sheet import document
from sdimu_calibration.report.drawing import Figure, html, lay_out
from sdimu_calibration.report.groups import title
from sdimu_calibration.storage.files.whole_file import write_whole

_DASHES = ("solid", "dash", "dot")
_COLUMNS = 2


def figure(content: Mapping[str, Any], units: Mapping[str, str]) -> Figure:
    """Draw RMS error against mount, one panel an effect, logarithmic; `units` are the display units by effect."""
    effects = list(units)
    rows = -(-len(effects) // _COLUMNS)
    titles = [title(effect) for effect in effects]
    drawn = Figure(rows, _COLUMNS, titles=titles, gap_x=0.1, gap_y=0.09)
    mounts = np.asarray(content["mount_deg"], dtype=float)
    for panel, effect in enumerate(effects):
        place = {"row": panel // _COLUMNS + 1, "col": panel % _COLUMNS + 1}
        for order, (estimator, by_effect) in enumerate(content["rms"].items()):
            factor = from_si(1.0, units[effect])
            drawn.add(
                "scatter", x=mounts, y=np.asarray(by_effect[effect]) * factor, mode="lines+markers", name=estimator,
                legendgroup=estimator, showlegend=panel == 0,
                error_y={"type": "data", "array": np.asarray(content["spread"][estimator][effect]) * factor},
                line={"color": SERIES[order % 3], "dash": _DASHES[order % 3]}, **place,
            )  # fmt: skip
        drawn.y_axes(type="log", dtick=1, exponentformat="power", title=f"RMS ({units[effect]})", **place)
        drawn.x_axes(title="mount (deg)" if panel >= len(effects) - _COLUMNS else None, **place)
    return lay_out(
        drawn, 260 * rows + 80, font={"size": 12}, showlegend=True,
        legend={"orientation": "h", "y": 1.06}, margin={"l": 70, "r": 30, "t": 60, "b": 50},
    )  # fmt: skip


def write_page(path: Path, content: Mapping[str, Any], units: Mapping[str, str]) -> None:
    """Write the page: one file that needs no network."""
    drawn = html(figure(content, units), 1)
    text = (
        f"{len(content['seeds'])} IMUs, each tested at every mount (the same angle about all axes). RMS over IMUs "
        "and axes; bars: its standard error. The classical estimator takes table axes for IMU axes. Turned into the "
        "accelerometers' own frame afterwards it loses most of the mount again: on a table whose angles are perfect."
    )
    heading = "Error against mount misalignment"
    write_whole(path, document(heading, f'<section class="card"><p>{escape(text)}</p>{drawn}</section>'))
