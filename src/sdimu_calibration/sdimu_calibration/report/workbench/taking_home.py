"""Callbacks for what comes from files and goes into them: an own effect that is read, an archive that is taken home."""

from __future__ import annotations

import base64
from typing import Any

from dash import Dash, Input, Output, dcc, no_update
from dash import State as Kept

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import UnitError
from sdimu_calibration.report.workbench.export import archive
from sdimu_calibration.report.workbench.own_effect import read_effect
from sdimu_calibration.report.workbench.recording_cache import RecordingCache
from sdimu_calibration.report.workbench.state import from_json
from sdimu_calibration.report.workbench.task_progress import BUSY, TaskProgress


def register(app: Dash, shelf: RecordingCache, doing: TaskProgress) -> None:
    """Make the callbacks."""
    _read_uploads(app)
    _pack_exports(app, shelf, doing)


def _read_uploads(app: Dash) -> None:
    """Put the file of an own effect into the page."""

    @app.callback(
        Output("own", "value"),
        Output("message", "children", allow_duplicate=True),
        Input("upload", "contents"),
        Kept("upload", "filename"),
        prevent_initial_call=True,
    )
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
            return text, f"{name}: {' '.join(str(error).split())}"
        return text, ""


def _pack_exports(app: Dash, shelf: RecordingCache, doing: TaskProgress) -> None:
    """Send what is taken home."""

    @app.callback(
        Output("file", "data"),
        Output("message", "children", allow_duplicate=True),
        Input("export", "n_clicks"),
        Kept("state", "data"),
        Kept("page", "data"),
        running=BUSY,
        prevent_initial_call=True,
    )
    def export(_clicks: Any, kept: Any, page: Any) -> tuple[Any, str]:
        now, tell = from_json(kept), doing.teller(str(page))
        try:
            bench = shelf.bench(now.recording)
            final = bench.final(now.now, tell)
            tell("report", 0.8)
            name = now.recording or shelf.names[0]
            packed = archive(bench.model, now, final, name, shelf.place(name), shelf.options)
        except (DataError, UnitError) as error:
            return no_update, f"Not done: {' '.join(str(error).split())}"
        return dcc.send_bytes(packed, "calibration.zip"), ""
