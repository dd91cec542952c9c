"""The dash application: callbacks that turn clicks into states and states into pictures."""

from __future__ import annotations

import base64
from typing import Any

import dash
import numpy as np
from dash import Dash, Input, Output, dcc, html, no_update
from dash import State as Kept

from sdimu_calibration.core.evidence.consistency import CHANNEL_NAMES
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import UnitError
from sdimu_calibration.report import data
from sdimu_calibration.report.design.library import PRINT
from sdimu_calibration.report.workbench import figures, tables, view
from sdimu_calibration.report.workbench.export import archive
from sdimu_calibration.report.workbench.fit import FitSession
from sdimu_calibration.report.workbench.guard import LOOPBACK, guard, tell_error
from sdimu_calibration.report.workbench.own_effect import named, read_effect
from sdimu_calibration.report.workbench.recording_cache import RecordingCache
from sdimu_calibration.report.workbench.state import State, from_json
from sdimu_calibration.report.workbench.task_progress import TaskProgress

_PAGE = """<!doctype html><html lang="en"><head>{%metas%}<title>{%title%}</title>{%css%}<style>STYLE</style></head>
<body>{%app_entry%}<footer>{%config%}{%scripts%}{%renderer%}<script>PRINT</script></footer></body></html>"""
_WORKING = [(Output("busy", "hidden"), False, True), (Output("tick", "disabled"), False, True)]
_BUSY = [
    *_WORKING,
    *((Output(button, "disabled"), True, False) for button in ("add", "undo", "add-own", "hold", "drop", "open")),
]
_LOOKING = [*_WORKING, (Output("candidates", "className"), "stale", ""), (Output("verdict", "className"),
            "verdict stale", "verdict")]  # fmt: skip
_LARGE = "function(_) { return window.innerWidth >= 2400 ? 1.6 : 1; }"
"""Figures count in pixels: on a screen of 4K they are drawn larger."""
_NOTHING = {
    "undo": "Nothing to undo.",
    "add": "Nothing added: choose an effect that is not in the model.",
    "add-own": "Nothing added: write an effect that is not in the model.",
    "drop": "Nothing taken out: choose an effect that was added.",
    "hold": "Nothing changed: these are the stops that are held out now.",
    "ranking": "Nothing added: it is in the model already.",
}
"""What a click that asks for nothing is told."""
_ARROW = "\N{BLACK RIGHT-POINTING TRIANGLE} "


def build(shelf: RecordingCache, host: str = LOOPBACK[0]) -> Dash:
    """Make the application of a shelf of recordings, to be served at an address of this machine."""
    app = Dash(
        "sdimu workbench", title="sdimu workbench", update_title="", serve_locally=True, assets_ignore=".*",
        on_error=tell_error,
    )  # fmt: skip
    guard(app.server, host)
    app.index_string = _PAGE.replace("STYLE", view.STYLE).replace("PRINT", PRINT)
    app.layout = lambda: view.layout("Workbench", shelf.names)
    doing = TaskProgress()
    app.clientside_callback(_LARGE, Output("scale", "data"), Input("page", "data"))
    _follow_clicks(app, shelf, doing)
    _show_states(app, shelf, doing)
    _search_candidates(app, shelf, doing)
    _read_uploads(app)
    _pack_exports(app, shelf, doing)
    _show_progress(app, doing)
    return app


def _follow_clicks(app: Dash, shelf: RecordingCache, doing: TaskProgress) -> None:
    """Turn clicks into states, each fitted before it is kept."""

    @app.callback(
        Output("state", "data"), Output("message", "children"),
        Input("add", "n_clicks"), Input("add-own", "n_clicks"), Input("undo", "n_clicks"), Input("hold", "n_clicks"),
        Input("drop", "n_clicks"), Input("open", "n_clicks"), Input("ranking", "clickData"), Input("heat", "clickData"),
        Kept("candidate", "value"), Kept("own", "value"), Kept("held", "value"), Kept("added", "value"),
        Kept("recording", "value"), Kept("state", "data"), Kept("page", "data"),
        running=_BUSY, prevent_initial_call=True,
    )  # fmt: skip
    def clicked(*values: Any) -> tuple[Any, Any]:
        *_, bar, point, candidate, own, held, chosen, recording, kept, page = values
        tell = doing.teller(str(page))
        try:
            now = from_json(kept)
            wanted = _step(now, dash.ctx.triggered_id, bar, point, candidate, own, held, chosen, recording)
            if wanted == now:
                return no_update, _NOTHING.get(str(dash.ctx.triggered_id), "")
            tell("read", 0.0)
            shelf.bench(wanted.recording).fit(wanted.added, wanted.held, tell)
        except (DataError, UnitError) as error:
            return no_update, f"Not done: {_line(error)}"
        return wanted.as_json(), ""


def _show_states(app: Dash, shelf: RecordingCache, doing: TaskProgress) -> None:
    """Show a state: numbers, pictures and tables."""

    @app.callback(
        Output("title", "children"), Output("numbers", "children"), Output("heat", "figure"),
        Output("cell", "figure"), Output("ladder", "figure"), Output("added", "options"), Output("held", "options"),
        Output("held", "value"), Output("moved", "children"), Output("models", "children"),
        Output("recording", "value"), Output("shown", "data"), Output("message", "children", allow_duplicate=True),
        Input("state", "modified_timestamp"), Input("scale", "data"), Kept("state", "data"), Kept("page", "data"),
        running=_BUSY, prevent_initial_call="initial_duplicate",
    )  # fmt: skip
    def show(_when: Any, scale: Any, kept: Any, page: Any) -> tuple[Any, ...]:
        now, told = from_json(kept), ""
        tell = doing.teller(str(page))
        try:
            bench = shelf.bench(now.recording)
            bench.fit(now.added, now.held, tell)
        except (DataError, UnitError) as error:  # the server was started anew, with other files
            now, told = State(), f"What this page held cannot be shown: {_line(error)}"
            bench = shelf.bench()
        return (*_shown(bench, now, now.recording or shelf.names[0], float(scale or 1), tell), now.as_json(), told)


def _search_candidates(app: Dash, shelf: RecordingCache, doing: TaskProgress) -> None:
    """Score the candidates of a state."""

    @app.callback(
        Output("verdict", "children"), Output("ranking", "figure"), Output("candidate", "options"),
        Input("shown", "data"), Kept("scale", "data"), Kept("page", "data"),
        running=_LOOKING, prevent_initial_call=True,
    )  # fmt: skip
    def search(kept: Any, scale: Any, page: Any) -> tuple[Any, ...]:
        now = from_json(kept)
        missing = shelf.bench(now.recording).missing(now.added, now.held, doing.teller(str(page)))
        picture = figures.enlarged(figures.ranking(missing.entries, missing.threshold), float(scale or 1))
        return view.verdict(missing), picture, view.options(missing.entries)


def _read_uploads(app: Dash) -> None:
    """Put the file of an own effect into the page."""

    @app.callback(
        Output("own", "value"), Output("message", "children", allow_duplicate=True),
        Input("upload", "contents"), Kept("upload", "filename"), prevent_initial_call=True,
    )  # fmt: skip
    def upload(contents: Any, name: Any) -> tuple[Any, str]:
        try:
            text = base64.b64decode(str(contents).partition(",")[2], validate=True).decode("utf-8")
            if "\n" not in text.strip():
                raise ValueError
        except ValueError:  # not base64, not UTF-8, no lines
            return no_update, f"Not read: {name} is no effect file (expected YAML, format: sdimu-effect/1)"
        try:
            read_effect(text)
        except (DataError, UnitError) as error:
            return text, f"{name}: {_line(error)}"
        return text, ""


def _pack_exports(app: Dash, shelf: RecordingCache, doing: TaskProgress) -> None:
    """Send what is taken home."""

    @app.callback(
        Output("file", "data"), Output("message", "children", allow_duplicate=True),
        Input("export", "n_clicks"), Kept("state", "data"), Kept("page", "data"), running=_BUSY,
        prevent_initial_call=True,
    )  # fmt: skip
    def export(_clicks: Any, kept: Any, page: Any) -> tuple[Any, str]:
        now, tell = from_json(kept), doing.teller(str(page))
        try:
            bench = shelf.bench(now.recording)
            final = bench.final(now.added, now.held, tell)
            tell("report", 0.8)
            packed = archive(bench.model, now.added, final, f"Workbench: {now.recording or shelf.names[0]}")
        except (DataError, UnitError) as error:
            return no_update, f"Not done: {_line(error)}"
        return dcc.send_bytes(packed, "calibration.zip"), ""


def _show_progress(app: Dash, doing: TaskProgress) -> None:
    """Say what the server does for a page."""

    @app.callback(
        Output("busy", "children"), Input("tick", "n_intervals"), Kept("page", "data"), prevent_initial_call=True
    )
    def progress(_count: Any, page: Any) -> Any:
        word, share = doing.at(str(page))
        return [f"{word} \u2026", html.Progress(value=f"{share:.2f}", max="1")]


def _step(
    now: State, what: Any, bar: Any, point: Any, candidate: Any, own: Any, held: Any, chosen: Any, recording: Any
) -> State:
    """Return the state that a click asks for; the same one when it asks for nothing."""
    if what == "undo":
        return now.undo()
    if what == "hold":
        return now.hold(tuple(held or ()))
    if what == "drop" and chosen:
        return now.drop(chosen)
    if what == "open" and recording:
        return now.open(str(recording))
    if what == "add-own" and own:
        return now.add(own)
    if what == "add" and candidate:
        return now.add(candidate)
    if what == "ranking" and bar:
        return now.add(str(bar["points"][0]["y"]).removeprefix(_ARROW))
    if what == "heat" and point:
        first = point["points"][0]
        return now.look(CHANNEL_NAMES.index(str(first["y"]).replace(" ", "_")), int(first["x"]))
    return now


def _shown(bench: FitSession, now: State, recording: str, scale: float, tell: Any) -> tuple[Any, ...]:
    """Everything that a state shows but the candidates, which come later."""
    rungs = [bench.fit(now.added[:k], now.held, tell) for k in range(len(now.added) + 1)]
    here, given = rungs[-1], rungs[0]
    cell = now.cell if now.cell and _is_in(here.grid, *now.cell) else _worst(here.grid)
    names = ["model as given", *(f"+ {named(text)}" for text in now.added)]
    keys = [(now.added[:k], now.held) for k in range(len(now.added) + 1)]
    keys = [*now.seen, *(key for key in keys if key not in now.seen)]
    pictures = (
        figures.heat_map(here.grid, cell), figures.cell(here.residuals, here.grid, *cell),
        figures.ladder(names, [r.held_out for r in rungs], [r.at_held for r in rungs]),
    )  # fmt: skip
    return (
        f"Workbench: {recording}",
        view.numbers(here, given),
        *(figures.enlarged(picture, scale) for picture in pictures),
        [{"label": named(text), "value": text} for text in now.added],
        [{"label": f"stop {s}", "value": s} for s in bench.stops],
        list(now.held),
        tables.moved(given.calibration, here.calibration),
        tables.models(bench, keys, (now.added, now.held)),
        recording,
    )


_SENSORS = 6
"""Channels from here on are measured every second: there is more to see."""


def _worst(grid: data.Grid) -> tuple[int, int]:
    row, column = np.unravel_index(np.nanargmax(np.abs(grid.value[_SENSORS:])), grid.value[_SENSORS:].shape)
    return int(row) + _SENSORS, int(grid.stops[column])


def _is_in(grid: data.Grid, channel: int, stop: int) -> bool:
    return 0 <= channel < len(grid.value) and stop in grid.stops


def _line(error: Exception) -> str:
    return " ".join(str(error).split())
