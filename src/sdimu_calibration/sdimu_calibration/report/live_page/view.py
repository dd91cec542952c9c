"""The layout of the live page; what it shows comes with the first callback."""

from __future__ import annotations

from importlib.resources import files
from typing import Any
from uuid import uuid4

from dash import dcc, html

from sdimu_calibration.report.workbench import view as workbench
from sdimu_calibration.report.workbench.elements import card, graph

_HERE = files("sdimu_calibration.report.live_page")
STYLE = workbench.STYLE + (_HERE / "page.css").read_text(encoding="utf-8")
SCRIPT = (_HERE / "page.js").read_text(encoding="utf-8")
EVERY_MS = 1000
"""Wall time (ms) after which a page asks what is new."""


def layout(folder: str, about: str = "") -> Any:
    """Lay a fresh page out.

    Parameters
    ----------
    folder : str
        Of the results; empty where nobody knows.
    about : str
        Which test it is of, beside the title.
    """
    where = f" The results are in {folder}." if folder else ""
    return html.Div(
        [
            dcc.Store(id="page", data=uuid4().hex),
            dcc.Store(id="look"),
            dcc.Store(id="known"),
            dcc.Interval(id="tick", interval=EVERY_MS),
            html.Div(
                f"The command that showed this test does not answer any more: it has ended, or it was stopped.{where} "
                "The page shows what it saw last.",
                id="lost",
                className="lost",
                role="alert",
                hidden=True,
            ),
            _bar(about),
            html.Main(html.Div([_left(), _middle(), _right()], className="bench live")),
        ]
    )


def _bar(about: str) -> Any:
    return html.Header(
        [
            html.Div(
                [
                    html.H1("Live test"),
                    html.Div(
                        [html.Div(about, className="about"), html.Div(id="place", className="place", role="status")],
                        className="grow",
                    ),
                    html.Button("Dark page", id="theme", **{"data-switch-theme": ""}),
                ],
                className="line",
            ),
            html.Div(id="light", className="light"),
            html.Div(id="verdict", className="verdict neutral", role="status"),
            html.Div(id="ended", className="no-end", role="status"),
            html.Div(id="message", className="message", role="alert"),
        ],
        className="bench-bar",
    )


def _left() -> Any:
    return html.Div(
        [
            card(
                "How well is it known? Sigmas over the test",
                graph("sigmas", "Sigma of each effect over that at the start, against time"),
                html.P(id="joined", className="quiet"),
            ),
            card(
                "Is the noise as promised? NIS of each stop, 1 is right", graph("nis", "NIS of every channel and stop")
            ),
        ],
        className="column",
    )


def _middle() -> Any:
    return html.Div(
        [
            card(
                "Where does it fail? Mean innovation over its sigma",
                graph("heat", "Normalised mean of every channel at every stop"),
            ),
            card(
                "How far the error fell: one stop left out",
                graph("errors", "Error with one stop left out, of each model, by stop"),
            ),
        ],
        className="column",
    )


def _right() -> Any:
    return html.Div(
        [
            card("Why this turn", html.Div(id="choices", className="told")),
            card(
                "Add to the model",
                dcc.Dropdown(id="candidate", placeholder="an effect of the catalogue"),
                html.Div(html.Button("Add it to this test", id="add", className="main-action"), className="controls"),
                html.Div(id="answer", className="told", role="status"),
                more="control",
            ),
            card("What is missing?", html.Div(id="candidates", className="told")),
        ],
        className="column",
    )
