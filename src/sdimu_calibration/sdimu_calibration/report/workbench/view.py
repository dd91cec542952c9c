"""What a page of the workbench shows: its layout, and its parts for a fit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from dash import dcc, html

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report import data
from sdimu_calibration.report.drawing import CONFIG

TEMPLATE = """format: sdimu-effect/1
name: my_effect
expressions:
  gyro_x: k * ex**2
parameters:
  k: {unit: deg/h, prior: 0.5 deg/h}
"""
"""What the field for an effect of one's own starts with."""

STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; color: #222; margin: 0; }
main { display: grid; grid-template-columns: 1fr 1fr; gap: 0 2em; }
@media (max-width: 1100px) { main { display: block; } }
@media (min-width: 2400px) { body { font-size: 20px; } }
main { padding: 0 1.5em; } section { min-width: 0; } .whole { grid-column: 1 / -1; }
h1 { font-size: 1.3em; margin: .6em 1.15em 0; } h2 { font-size: 1.05em; margin: 1em 0 .3em; }
.verdict { border: 2px solid #222; border-left-width: 12px; padding: .5em 1em; margin: .6em 1.5em; }
.message { color: #7a1f00; font-weight: 600; margin: .3em 1.5em; min-height: 1.4em; }
.busy { position: fixed; top: .6em; right: 1.5em; background: #222; color: #fff; padding: .4em 1em; }
button { font: inherit; padding: .2em 1em; margin: .3em .5em .3em 0; cursor: pointer; }
textarea { width: 100%; font: 13px/1.4 ui-monospace, monospace; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .1em .7em; text-align: right; border-bottom: 1px solid #ddd; }
th:first-child, td:first-child { text-align: left; }
"""


def layout(title: str, stops: Sequence[int]) -> Any:
    """Lay the page out; figures come with the first callback."""
    held = [{"label": f"stop {s}", "value": s} for s in stops]
    return html.Div([
        dcc.Store(id="state", storage_type="session"),
        html.Div("Fitting \u2026", id="busy", className="busy", hidden=True),
        html.H1(title),
        html.Div(id="verdict", className="verdict"),
        html.Div(id="message", className="message", role="alert"),
        html.Main([
            html.Section([
                html.H2("Where does it fail? Click a cell"), _graph("heat"), _graph("cell"),
            ], className="whole"),
            html.Section([
                html.H2("How far the error fell"), _graph("ladder"),
                html.H2("Coefficients that moved against the model as given"), html.Div(id="moved"),
            ]),
            html.Section([
                html.H2("Which effect is missing? Click a bar to add it"), _graph("ranking"),
                dcc.Dropdown(id="candidate", placeholder="or search the catalogue"),
                html.Button("Add", id="add"), html.Button("Undo", id="undo"),
                html.H2("In the model besides"),
                dcc.Dropdown(id="added", placeholder="nothing yet"), html.Button("Take out", id="drop"),
                html.H2("An effect of your own"),
                dcc.Textarea(id="own", value=TEMPLATE, rows=8, persistence=True, persistence_type="session"),
                html.Button("Add this", id="add-own"),
                html.H2("Stops held out of the fit"),
                dcc.Dropdown(id="held", options=held, multi=True, placeholder="none"),
                html.Button("Hold out", id="hold"),
                html.H2("Take home"), html.Button("Model, calibration and report", id="export"),
                dcc.Download(id="file"),
            ]),
        ]),
    ])  # fmt: skip


def _graph(name: str) -> Any:
    # Plotly's own "responsive" would take the height of the container, which has none; the component follows the width.
    return dcc.Graph(id=name, config={key: value for key, value in CONFIG.items() if key != "responsive"})


def options(entries: Sequence[data.Scored]) -> list[dict[str, str]]:
    """Candidates for the search field, with their evidence."""
    return [
        {
            "label": f"{e.label}   |z| {abs(e.z):.1f}   {e.estimate:.3g} \u00b1 {e.sigma:.2g} {e.unit}",
            "value": e.label,
        }
        for e in entries
        if np.isfinite(e.sigma)
    ]


def verdict(diagnosis: Diagnosis, held_out: float, at_held: float | None) -> str:
    """Return the verdict in one line."""
    mark = "\N{CHECK MARK}" if diagnosis.adequate else "\N{HEAVY BALLOT X}"
    held = "" if at_held is None else f", {at_held:.3f} at the stops held out"
    left = diagnosis.remainder_after
    return (
        f"{mark} {diagnosis.sentence} Held-out RMS {held_out:.3f} sigma{held}; "
        f"free inputs {left.chi2:.0f} of {left.dof}; squared innovations {diagnosis.consistency.nis_mean:.3f}."
    )


def moved(first: Calibration, now: Calibration, most: int = 8) -> Any:
    """Table of the coefficients that differ most between two fits, in sigmas of the later one."""
    at = {name: i for i, name in enumerate(first.names)}
    sigma = np.sqrt(np.diag(now.covariance))
    rows = []
    for i, name in enumerate(now.names):
        if name in at and sigma[i] > 0.0 and first.covariance[at[name], at[name]] > 0.0:
            rows.append((abs(now.values[i] - first.values[at[name]]) / sigma[i], i, at[name]))
    cells = [html.Tr([html.Th(word) for word in ("coefficient", "as given", "now", "sigma", "unit", "moved (sigma)")])]
    for size, i, k in sorted(rows, reverse=True)[:most]:
        if size < _STANDS:
            break
        unit = now.display_units[i]
        numbers = (first.values[k], now.values[i], sigma[i])
        cells.append(html.Tr([
            html.Td(now.names[i]), *(html.Td(f"{from_si(float(v), unit):.4g}") for v in numbers), html.Td(unit),
            html.Td(f"{size:.1f}"),
        ]))  # fmt: skip
    return html.Table(cells) if len(cells) > 1 else "none"


_STANDS = 0.01
