"""The layout of a page of the workbench; figures and texts come with the first callback."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files
from typing import Any
from uuid import uuid4

from dash import dcc, html

from sdimu_calibration.core.evidence.consistency import CHANNEL_NAMES
from sdimu_calibration.report.workbench.axes import STOP, TIME
from sdimu_calibration.report.workbench.elements import card, graph

TEMPLATE = """format: sdimu-effect/1
name: my_effect
expressions:
  gyro_x: k * ex**2
parameters:
  k: {unit: deg/h, prior: 0.5 deg/h}
"""
"""What the field for an effect of one's own starts with."""
_HERE = files("sdimu_calibration.report.workbench")
STYLE = (_HERE / "page.css").read_text(encoding="utf-8")
SCRIPT = (_HERE / "page.js").read_text(encoding="utf-8")
NOW, GIVEN, WITH = "now", "given", "with"
SHOWS = {GIVEN: "as given", NOW: "now", WITH: "with the candidate"}
"""What the heat map and the residuals are of."""
_KEYS = (
    ("?", "this list"),
    ("Ctrl+Z, U", "undo"),
    ("Ctrl+Y, Ctrl+Shift+Z, R", "redo"),
    ("J, K", "next and previous candidate"),
    ("A", "add the candidate"),
    ("B", "as given, now, with the candidate"),
    ("S", "leave the stop out, or take it in"),
    ("X, I", "leave selected points out, take them in"),
    ("E", "take home"),
    ("C", "coefficients, open or closed"),
    ("Enter", "in the row of a coefficient: take this prior"),
    ("Esc", "close this list, or the coefficients"),
)


def layout(title: str, together: bool = False) -> Any:
    """Lay a fresh page out. `together`: they can be judged as one set."""
    return html.Div(
        [
            dcc.Store(id="state", storage_type="session"),
            dcc.Store(id="page", data=uuid4().hex),
            dcc.Store(id="look"),
            dcc.Store(id="shown"),
            dcc.Store(id="stop"),
            dcc.Store(id="looked"),
            dcc.Store(id="edits"),
            dcc.Interval(id="tick", interval=200, disabled=True),
            html.Div(
                "The workbench does not answer any more. Start it again with the same command: this page then goes on "
                "where it was; nothing that you did is lost.",
                id="lost",
                className="lost",
                role="alert",
                hidden=True,
            ),
            _help(),
            _bar(title),
            html.Main(
                [
                    html.Div(
                        [
                            html.Div([_left(), _middle(), _right()], className="bench"),
                            html.Div(
                                [
                                    _own(),
                                    _home(),
                                    *([_set()] if together else []),
                                    card(
                                        "Models of this page side by side",
                                        html.Div(id="models", className="scroll"),
                                        more="whole",
                                    ),
                                ],
                                className="below",
                            ),
                        ]
                    )
                ]
            ),
            _coefficients(),
        ]
    )


def _bar(title: str) -> Any:
    return html.Header(
        [
            html.Div(
                [
                    html.H1(title),
                    html.Div([html.Div(id="about", className="about"), html.Div(id="numbers")], className="grow"),
                    html.Div(["Working", html.Progress(value="0", max="1")], id="busy", className="busy", hidden=True),
                    html.Button("Undo", id="undo", title="Ctrl+Z"),
                    html.Button("Redo", id="redo", title="Ctrl+Y"),
                    html.Button("Dark page", id="theme", **{"data-switch-theme": ""}),
                    html.Button("Coefficients", id="coefficients-open", title="C", **{"aria-controls": "drawer"}),
                    html.Button("Keys ?", id="help-open", **{"aria-controls": "help"}),
                ],
                className="line",
            ),
            html.Div(id="verdict", className="verdict", role="status"),
            html.Ul(id="objections", className="objections"),
            html.Div(id="message", className="message", role="alert"),
        ],
        className="bench-bar",
    )


def _help() -> Any:
    rows = [html.Tr([html.Td(_keys(keys)), html.Td(what)]) for keys, what in _KEYS]
    return html.Div(
        [html.H2("Keys"), html.Table(html.Tbody(rows)), html.Button("Close", id="help-close")],
        id="help",
        className="help",
        role="dialog",
        hidden=True,
        tabIndex="-1",
        **{"aria-label": "Keys"},
    )


def _keys(keys: str) -> list[Any]:
    return [part for key in keys.split(", ") for part in (html.Kbd(key), " ")]


def _left() -> Any:
    return html.Div(
        [
            card(
                "Where does it fail? Click a cell",
                html.Div(
                    [
                        dcc.RadioItems(
                            id="shows",
                            options=[{"label": words, "value": key} for key, words in SHOWS.items()],
                            value=NOW,
                            inline=True,
                            className="choices",
                        ),
                        html.Button("Leave stop out / take in", id="toggle-stop", title="S"),
                    ],
                    className="controls",
                ),
                graph("heat", "Normalised mean of every channel at every stop"),
            ),
            card(
                "Residuals: click points, or draw a box",
                html.Div(
                    [
                        _picker(
                            "channel",
                            "channel",
                            [{"label": name.replace("_", " "), "value": k} for k, name in enumerate(CHANNEL_NAMES)],
                            None,
                        ),
                        _picker("against", "against", [TIME, STOP], TIME),
                        dcc.RadioItems(
                            id="which",
                            options=[{"label": "this stop", "value": "one"}, {"label": "all", "value": "all"}],
                            value="one",
                            inline=True,
                            className="choices",
                        ),
                        html.Button("Leave out", id="leave-points", title="X"),
                        html.Button("Take in", id="take-points", title="I"),
                    ],
                    className="controls",
                ),
                graph("residuals", "Residuals of the channel that is looked at"),
            ),
        ],
        className="column",
    )


def _middle() -> Any:
    return html.Div(
        [
            card(
                "What is missing? Click a bar",
                dcc.Dropdown(id="candidate", placeholder="or search the catalogue"),
                html.Div(graph("ranking", "Score of every candidate"), id="candidates"),
            ),
            card(
                "How far the error fell: one stop left out",
                graph("ladder", "Error of each model with one stop left out, and its metres"),
                html.P(id="in-use", className="quiet"),
            ),
        ],
        className="column",
    )


def _right() -> Any:
    return html.Div(
        [
            card("How probable each cause is", html.Div(id="odds")),
            card(
                "The candidate",
                html.Div("Click a bar, or press J.", id="preview", className="candidate"),
                html.Div(
                    html.Button("Add it and fit", id="add", className="main-action", title="A"), className="controls"
                ),
            ),
            card(
                "Added to the model",
                dcc.Dropdown(id="added", placeholder="choose one to take out"),
                html.Div(html.Button("Take out", id="drop"), className="controls"),
                more="control",
            ),
            card(
                "Left out of the fit",
                dcc.Dropdown(id="held", options=[], multi=True, placeholder="no stop"),
                html.Div([html.Button("Leave these stops out", id="hold"), html.Span(id="cut")], className="controls"),
                more="control",
            ),
            card(
                "Recording",
                dcc.Dropdown(id="recording", options=[], clearable=False),
                html.Div(html.Button("Open", id="open"), className="controls"),
                more="control",
            ),
        ],
        className="column",
    )


def _coefficients() -> Any:
    """Return a drawer at the foot of the page, which leaves the heat map in sight; the row that is chosen is edited."""
    editor = [
        html.Label(["value ", dcc.Input(id="mean", type="text", value="", debounce=False)]),
        html.Label(["sigma ", dcc.Input(id="sigma", type="text", value="", debounce=False)]),
        html.Button("Take this prior", id="set-prior", title="Enter"),
        html.Button("Fix at this value", id="fix"),
        html.Button("Free again", id="free"),
    ]
    return html.Section(
        [
            html.Div(
                [
                    html.H2("Coefficients"),
                    html.Div(
                        dcc.Dropdown(id="coefficient", placeholder="click a row to edit it, or search one here"),
                        className="grow",
                    ),
                    html.Button("Close", id="coefficients-close", title="C"),
                ],
                className="line control",
            ),
            html.Div(
                [
                    html.Div(id="coefficients", className="scroll"),
                    html.Div(editor, id="editor", className="controls control editor", hidden=True),
                ],
                className="rows",
            ),
        ],
        id="drawer",
        className="card drawer",
        hidden=True,
        tabIndex="-1",
        **{"aria-label": "Coefficients"},
    )


def _own() -> Any:
    return card(
        "An effect of your own, as an expression",
        html.Label("Effect file", htmlFor="own", className="switch"),
        dcc.Textarea(id="own", value=TEMPLATE, rows=8, persistence=True, persistence_type="session"),
        html.Div(
            [
                html.Button("Look at it", id="look-own"),
                html.Button("Add this", id="add-own"),
                dcc.Upload(html.Button("Read a file"), id="upload", accept=".yaml,.yml"),
            ],
            className="controls",
        ),
        more="control",
    )


def _home() -> Any:
    return card(
        "Take home",
        html.P("Model, calibration, report, the session and the command that gives the same numbers."),
        html.Button("Model, calibration and report", id="export", title="E"),
        dcc.Download(id="file"),
        more="control",
    )


def _set() -> Any:
    return card(
        "All recordings together",
        html.P("One fit of the recordings as one unit, with the effects that are added here."),
        html.Button("Judge them together", id="judge"),
        html.Div(id="judged", className="scroll"),
    )


def _picker(name: str, words: str, options: Sequence[Any], value: Any) -> Any:
    return html.Label(
        [words, dcc.Dropdown(id=name, options=list(options), value=value, clearable=False, className="pick")]
    )
