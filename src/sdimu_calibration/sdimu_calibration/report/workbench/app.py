"""The dash application: callbacks that turn clicks into states and states into pictures."""

from __future__ import annotations

from typing import Any

import dash
import numpy as np
from dash import Dash, Input, Output, dcc, no_update
from dash import State as Kept

from sdimu_calibration.core.diagnosis.consistency import CHANNEL_NAMES
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import UnitError
from sdimu_calibration.report import data, evidence_figures
from sdimu_calibration.report.workbench import figures, view
from sdimu_calibration.report.workbench.export import archive
from sdimu_calibration.report.workbench.fit import Bench, Fitted
from sdimu_calibration.report.workbench.state import State, from_json

_PAGE = """<!doctype html><html lang="en"><head>{%metas%}<title>{%title%}</title>{%css%}<style>STYLE</style></head>
<body>{%app_entry%}<footer>{%config%}{%scripts%}{%renderer%}</footer></body></html>"""
_BUSY = [
    (Output("busy", "hidden"), False, True),
    *((Output(button, "disabled"), True, False) for button in ("add", "undo", "add-own", "hold", "drop")),
]


def build(bench: Bench, title: str) -> Dash:
    """Make the application of one recording."""
    app = Dash("sdimu workbench", title=title, update_title="", serve_locally=True, assets_ignore=".*")
    app.index_string = _PAGE.replace("STYLE", view.STYLE)
    app.layout = view.layout(title, bench.stops)

    @app.callback(
        Output("state", "data"), Output("message", "children"),
        Input("add", "n_clicks"), Input("add-own", "n_clicks"), Input("undo", "n_clicks"), Input("hold", "n_clicks"),
        Input("drop", "n_clicks"), Input("ranking", "clickData"), Input("heat", "clickData"),
        Kept("candidate", "value"), Kept("own", "value"), Kept("held", "value"), Kept("added", "value"),
        Kept("state", "data"),
        running=_BUSY, prevent_initial_call=True,
    )  # fmt: skip
    def clicked(*values: Any) -> tuple[Any, Any]:
        *_, bar, point, candidate, own, held, chosen, kept = values
        now = from_json(kept)
        what = dash.ctx.triggered_id
        wanted = _step(now, what, bar, point, candidate, own, held, chosen)
        if wanted == now:
            return no_update, ""
        try:
            bench.fit(wanted.added, wanted.held)
        except (DataError, UnitError) as error:
            return no_update, f"Not done: {error}"
        return wanted.as_json(), ""

    @app.callback(
        Output("verdict", "children"), Output("heat", "figure"), Output("cell", "figure"), Output("ladder", "figure"),
        Output("ranking", "figure"), Output("candidate", "options"), Output("added", "options"),
        Output("held", "value"), Output("moved", "children"),
        Input("state", "modified_timestamp"), Kept("state", "data"), running=_BUSY[:1],
    )  # fmt: skip
    def show(_when: Any, kept: Any) -> tuple[Any, ...]:
        return _shown(bench, from_json(kept))

    @app.callback(
        Output("file", "data"), Input("export", "n_clicks"), Kept("state", "data"), running=_BUSY[:1],
        prevent_initial_call=True,
    )  # fmt: skip
    def export(_clicks: Any, kept: Any) -> Any:
        now = from_json(kept)
        packed = archive(bench.model, now.added, bench.fit(now.added, now.held), title)
        return dcc.send_bytes(packed, "calibration.zip")

    return app


def _step(
    now: State, what: Any, bar: Any, point: Any, candidate: Any, own: Any, held: Any, chosen: Any
) -> State:  # fmt: skip
    """Return the state that a click asks for; the same one when it asks for nothing."""
    if what == "undo":
        return now.undo()
    if what == "hold":
        return now.hold(tuple(held or ()))
    if what == "drop" and chosen:
        return now.drop(chosen)
    if what == "add-own" and own:
        return now.add(own)
    if what == "add" and candidate:
        return now.add(candidate)
    if what == "ranking" and bar:
        return now.add(str(bar["points"][0]["y"]).removeprefix("\N{BLACK RIGHT-POINTING TRIANGLE} "))
    if what == "heat" and point:
        first = point["points"][0]
        return now.look(CHANNEL_NAMES.index(str(first["y"]).replace(" ", "_")), int(first["x"]))
    return now


def _shown(bench: Bench, now: State) -> tuple[Any, ...]:
    """Everything that a state shows."""
    rungs = [bench.fit(now.added[:k], now.held) for k in range(len(now.added) + 1)]
    here: Fitted = rungs[-1]
    diagnosis = here.diagnosis
    entries = data.scored(diagnosis)
    grid = data.where(diagnosis.consistency)
    channel, stop = now.cell or _worst(grid)
    names = ["model as given", *(f"+ {_named(text)}" for text in now.added)]
    return (
        view.verdict(diagnosis, here.held_out, here.at_held),
        evidence_figures.heat_map(grid),
        figures.cell(data.residuals(diagnosis), channel, stop),
        figures.ladder(names, [r.held_out for r in rungs], [r.at_held for r in rungs]),
        evidence_figures.ranking(entries, diagnosis.found.threshold),
        view.options(entries),
        [{"label": _named(text), "value": text} for text in now.added],
        list(now.held),
        view.moved(rungs[0].diagnosis.after, diagnosis.after),
    )


_SENSORS = 6
"""Channels from here on are measured every second: there is more to see."""


def _worst(grid: data.Grid) -> tuple[int, int]:
    row, column = np.unravel_index(np.nanargmax(np.abs(grid.value[_SENSORS:])), grid.value[_SENSORS:].shape)
    return int(row) + _SENSORS, int(grid.stops[column])


def _named(text: str) -> str:
    """Name of an added effect; an own one says it on its line ``name:``."""
    lines = [line.partition(":")[2].strip() for line in text.splitlines() if line.startswith("name:")]
    return lines[0] if lines else text
