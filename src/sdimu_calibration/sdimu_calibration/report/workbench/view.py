"""What a page of the workbench shows: its layout, and its parts for a fit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from uuid import uuid4

import numpy as np
from dash import dcc, html

from sdimu_calibration.report import data
from sdimu_calibration.report.design.library import CONFIG
from sdimu_calibration.report.table import with_sigma
from sdimu_calibration.report.workbench.fit import Fitted, Missing

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
@media (max-width: 1000px) { main { display: block; } }
@media (min-width: 2400px) { body { font-size: 24px; } }
main { padding: 0 1.5em; } section { min-width: 0; } .whole { grid-column: 1 / -1; overflow-x: auto; }
header { position: sticky; top: 0; z-index: 5; background: #fff; }
header { padding: .3em 1.5em .4em; border-bottom: 1px solid #bbb; }
h1 { font-size: 1.2em; margin: .1em 0; } h2 { font-size: 1.05em; margin: 1em 0 .3em; }
.verdict { border: 2px solid #222; border-left-width: 12px; padding: .3em 1em; }
.line { display: flex; align-items: center; gap: 1em; flex-wrap: wrap; }
.line .grow { flex: 1 1 12em; min-width: 0; }
.message { color: #7a1f00; font-weight: 600; } .message:empty { display: none; }
.message::before { content: "\\26A0\\00A0"; }
.busy { background: #222; color: #fff; padding: .2em 1em; margin-left: auto; } .busy[hidden] { display: none; }
.busy progress { width: 8em; margin-left: 1em; vertical-align: middle; }
button { font: inherit; padding: .2em 1em; margin: .3em .5em .3em 0; cursor: pointer; }
button:disabled { cursor: wait; opacity: .5; } .stale { opacity: .35; }
textarea { width: 100%; box-sizing: border-box; font: .9em/1.4 ui-monospace, monospace; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .93em; }
th, td { padding: .1em .7em; text-align: right; border-bottom: 1px solid #ddd; }
th:first-child, td:first-child { text-align: left; }
tr.here td { font-weight: 700; } tr.here td:first-child::before { content: "\\25B6\\00A0"; }
@media print {
  @page { size: A4 portrait; margin: 12mm; }
  body { font-size: 11px; } main { display: block; } main, header { padding-left: 0; padding-right: 0; }
  button, .busy, .control, .modebar-container { display: none !important; } header { position: static; }
  :has(> .js-plotly-plot), tr { break-inside: avoid; } h2 { break-after: avoid; }
  .verdict, .dash-graph { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
}
"""


def layout(title: str, recordings: Sequence[str]) -> Any:
    """Lay a fresh page out; figures come with the first callback."""
    return html.Div([
        dcc.Store(id="state", storage_type="session"), dcc.Store(id="page", data=uuid4().hex),
        dcc.Store(id="scale"), dcc.Store(id="shown"), dcc.Interval(id="tick", interval=200, disabled=True),
        html.Header([
            html.Div([
                html.H1(title, id="title"),
                html.Div(["Working", html.Progress(value="0", max="1")], id="busy", className="busy", hidden=True),
            ], className="line"),
            html.Div(id="verdict", className="verdict", role="status"),
            html.Div([html.Div(id="numbers", className="grow"), html.Button("Undo", id="undo")], className="line"),
            html.Div(id="message", className="message", role="alert"),
        ]),
        html.Main([
            html.Section([
                html.H2("Where does it fail? Click a cell"), _graph("heat"), _graph("cell"),
            ], className="whole"),
            html.Section([
                html.H2("How far the error fell"), _graph("ladder"),
                html.H2("Coefficients that moved against the model as given"), html.Div(id="moved"),
                html.Div([
                    html.H2("Stops held out of the fit"),
                    dcc.Dropdown(id="held", options=[], multi=True, placeholder="none"),
                    html.Button("Hold out", id="hold"),
                    html.H2("Take home"), html.Button("Model, calibration and report", id="export"),
                    dcc.Download(id="file"),
                    html.H2("Another recording of this folder"),
                    dcc.Dropdown(id="recording", options=list(recordings), clearable=False),
                    html.Button("Open", id="open"),
                ], className="control"),
            ]),
            html.Section([
                html.H2("Which effect is missing? Click a bar to add it"), html.Div(_graph("ranking"), id="candidates"),
                html.Div([
                    dcc.Dropdown(id="candidate", placeholder="or search the catalogue"),
                    html.Button("Add", id="add"),
                    html.H2("Added to the model"),
                    dcc.Dropdown(id="added", placeholder="choose one to take out"), html.Button("Take out", id="drop"),
                    html.H2("An effect of your own, as an expression"),
                    dcc.Textarea(id="own", value=TEMPLATE, rows=8, persistence=True, persistence_type="session"),
                    html.Div([
                        html.Button("Add this", id="add-own"),
                        dcc.Upload(html.Button("Read a file"), id="upload", accept=".yaml,.yml"),
                    ], className="line"),
                ], className="control"),
            ]),
            html.Section([html.H2("Models of this page side by side"), html.Div(id="models")], className="whole"),
        ]),
    ])  # fmt: skip


def _graph(name: str) -> Any:
    # Plotly's own "responsive" would take the height of the container, which has none; the component follows the width.
    return dcc.Graph(id=name, config={key: value for key, value in CONFIG.items() if key != "responsive"})


def options(entries: Sequence[data.Scored]) -> list[dict[str, str]]:
    """Candidates for the search field, with their evidence."""
    return [
        {
            "label": f"{e.label}   |z| {abs(e.z):.1f}   {with_sigma(e.estimate, e.sigma, e.unit)}",
            "value": e.label,
        }
        for e in entries
        if np.isfinite(e.sigma)
    ]


def verdict(missing: Missing) -> str:
    """Return the verdict in one line."""
    mark = "\N{CHECK MARK}" if missing.adequate else "\N{HEAVY BALLOT X}"
    left = missing.left
    return (
        f"{mark} {missing.sentence} Unexplained sensor error, stop by stop: chi-square {left.chi2:.0f} "
        f"for {left.dof} degrees of freedom."
    )


def numbers(fitted: Fitted, given: Fitted) -> str:
    """Return how well a fit predicts, in one line."""
    fell = "" if fitted is given else f"{given.held_out:.3f} \N{RIGHTWARDS ARROW} "
    held = "" if fitted.at_held is None else f"; at the stops held out {fitted.at_held:.3f}"
    nis = fitted.calibration.fit["nis_mean"]
    errors = f"Held-out RMS {fell}{fitted.held_out:.3f} sigma{held}; mean squared innovation {nis:.3f}. 1 is right."
    return " ".join([errors, *(f"{line}." for line in fitted.calibration.inseparable)])
