"""The dash application: one page, and callbacks that turn clicks into states and states into pictures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import dash
from dash import Dash, Input, Output, no_update
from dash import State as Kept

from sdimu_calibration.core.joint.set_diagnosis import SetDiagnosis
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import UnitError
from sdimu_calibration.report.workbench import looking, showing, taking_home, together, view
from sdimu_calibration.report.workbench.dash_page import application
from sdimu_calibration.report.workbench.guard import LOOPBACK
from sdimu_calibration.report.workbench.recording_cache import RecordingCache
from sdimu_calibration.report.workbench.state import from_json
from sdimu_calibration.report.workbench.steps import BUTTONS, NOTHING, step
from sdimu_calibration.report.workbench.task_progress import BUSY, TaskProgress

_CONTROLS = {
    "candidate": Kept("candidate", "value"),
    "own": Kept("own", "value"),
    "held": Kept("held", "value"),
    "added": Kept("added", "value"),
    "recording": Kept("recording", "value"),
    "stop": Kept("stop", "data"),
    "points": Kept("residuals", "selectedData"),
    "coefficient": Kept("coefficient", "value"),
    "mean": Kept("mean", "value"),
    "sigma": Kept("sigma", "value"),
}

Judge = Callable[[Sequence[str], Callable[[str, float], None]], SetDiagnosis]


def build(shelf: RecordingCache, host: str = LOOPBACK[0], judge: Judge | None = None) -> Dash:
    """Make the application of a shelf of recordings, to be served at an address of this machine.

    `judge`: diagnoses all recordings of the shelf as one set, with some effects added.
    """
    app = application("sdimu workbench", host, view.STYLE, view.SCRIPT)
    app.layout = lambda: view.layout("Workbench", judge is not None)
    doing = TaskProgress()
    _follow_clicks(app, shelf, doing)
    showing.register(app, shelf, doing)
    looking.register(app, shelf, doing)
    taking_home.register(app, shelf, doing)
    if judge is not None:
        together.register(app, judge, doing)
    # The row that is edited is found again in each table that comes.
    app.clientside_callback(
        "function(name, _) { return window.benchEdit(name); }",
        Output("edits", "data"),
        Input("coefficient", "value"),
        Input("coefficients", "children"),
    )
    return app


def _follow_clicks(app: Dash, shelf: RecordingCache, doing: TaskProgress) -> None:
    """Turn clicks into states, each fitted before it is kept."""

    @app.callback(
        output=[Output("state", "data"), Output("message", "children")],
        inputs={
            "clicks": [Input(name, "n_clicks") for name in BUTTONS],
            "seen": {"cell": Input("heat", "clickData"), "channel": Input("channel", "value")},
            "controls": _CONTROLS,
            "kept": Kept("state", "data"),
            "page": Kept("page", "data"),
        },
        running=BUSY,
        prevent_initial_call=True,
    )
    def clicked(clicks: Any, seen: Any, controls: Any, kept: Any, page: Any) -> tuple[Any, Any]:
        del clicks
        tell, what = doing.teller(str(page)), str(dash.ctx.triggered_id)
        try:
            now = from_json(kept)
            wanted = step(now, what, {**controls, **seen})
            if wanted == now:
                return no_update, NOTHING.get(what, "")
            tell("read", 0.0)
            shelf.bench(wanted.recording).fit(wanted.now, tell)
        except (DataError, UnitError) as error:
            return no_update, f"Not done: {' '.join(str(error).split())}"
        return wanted.as_json(), ""
