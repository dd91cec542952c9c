"""Callbacks that look for what is missing: scores of all candidates, and one of them before it is added."""

from __future__ import annotations

from typing import Any

import dash
from dash import Dash, Input, Output, dcc, html, no_update
from dash import State as Kept

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import UnitError
from sdimu_calibration.report.unknown_section import followed
from sdimu_calibration.report.workbench import figures, parts
from sdimu_calibration.report.workbench.fit import Missing
from sdimu_calibration.report.workbench.own_effect import named
from sdimu_calibration.report.workbench.recording_cache import RecordingCache
from sdimu_calibration.report.workbench.showing import ladder
from sdimu_calibration.report.workbench.state import from_json
from sdimu_calibration.report.workbench.task_progress import LOOKING, TaskProgress

_ARROW = "\N{BLACK RIGHT-POINTING TRIANGLE} "


def register(app: Dash, shelf: RecordingCache, doing: TaskProgress) -> None:
    """Make the callbacks."""
    _score(app, shelf, doing)
    _choose(app)
    _look(app, shelf, doing)


def _score(app: Dash, shelf: RecordingCache, doing: TaskProgress) -> None:
    @app.callback(
        Output("verdict", "children"),
        Output("verdict", "className"),
        Output("odds", "children"),
        Output("objections", "children"),
        Output("ranking", "figure"),
        Output("candidate", "options"),
        Output("candidate", "value"),
        Output("ladder", "figure", allow_duplicate=True),
        Output("in-use", "children"),
        Input("shown", "data"),
        Kept("look", "data"),
        Kept("candidate", "value"),
        Kept("page", "data"),
        running=LOOKING,
        prevent_initial_call=True,
    )
    def search(kept: Any, look: Any, chosen: Any, page: Any) -> tuple[Any, ...]:
        now, tell = from_json(kept), doing.teller(str(page))
        bench = shelf.bench(now.recording)
        against = bench.objections(now.now, tell)
        missing = bench.missing(now.now, tell)
        told, tone = parts.verdict(missing, against)
        picture = figures.finished(figures.ranking(missing.entries, missing.threshold, missing.classes), look)
        still = chosen if chosen in {entry.label for entry in missing.entries} else None
        lines = [html.Li(line) for line in against]
        return (
            told,
            tone,
            [*parts.odds(missing), *_unknown(missing, look)],
            lines,
            picture,
            parts.options(missing.entries),
            still,
            ladder(bench, now.now, look, tell),
            parts.in_use(missing.in_use),
        )


def _choose(app: Dash) -> None:
    """Take the bar that is clicked."""

    @app.callback(
        Output("candidate", "value", allow_duplicate=True), Input("ranking", "clickData"), prevent_initial_call=True
    )
    def choose(bar: Any) -> Any:
        return str(bar["points"][0]["y"]).removeprefix(_ARROW) if bar else no_update


def _look(app: Dash, shelf: RecordingCache, doing: TaskProgress) -> None:
    """Show the candidate that is chosen, or the effect that is written, before it is added."""

    @app.callback(
        Output("preview", "children"),
        Output("looked", "data"),
        Output("message", "children", allow_duplicate=True),
        Input("candidate", "value"),
        Input("look-own", "n_clicks"),
        Input("shown", "data"),
        Kept("own", "value"),
        Kept("looked", "data"),
        Kept("page", "data"),
        prevent_initial_call=True,
    )
    def look(candidate: Any, _clicks: Any, kept: Any, own: Any, looked: Any, page: Any) -> tuple[Any, Any, Any]:
        now = from_json(kept)
        typed = dash.ctx.triggered_id == "look-own"
        text = own if typed else candidate
        if not text:
            # A redrawn figure loses the points that are selected: drawn anew only where a candidate was shown.
            return "Click a bar, or press J.", None if looked else no_update, no_update
        try:
            found = shelf.bench(now.recording).preview(now.now, str(text), doing.teller(str(page)))
        except (DataError, UnitError) as error:
            why = f"Not shown: {' '.join(str(error).split())}"
            return "Click a bar, or press J.", None, why if typed else no_update
        return parts.candidate(found, named(str(text))), str(text), ""


def _unknown(missing: Missing, look: Any) -> list[Any]:
    """Draw each error that no effect explains against what it follows, with its band."""
    return [dcc.Graph(figure=figures.finished(followed(one), look)) for one in missing.unknown]
