"""Callbacks that show a state: numbers, pictures and tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from dash import Dash, Input, Output, html, no_update
from dash import State as Kept

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import UnitError
from sdimu_calibration.report import data
from sdimu_calibration.report.beside_title import of_calibration
from sdimu_calibration.report.workbench import figures, parts, tables
from sdimu_calibration.report.workbench.elements import explained
from sdimu_calibration.report.workbench.fit import FitSession, Fitted, Preview, Tell
from sdimu_calibration.report.workbench.own_effect import named
from sdimu_calibration.report.workbench.recording_cache import RecordingCache
from sdimu_calibration.report.workbench.setting import Setting
from sdimu_calibration.report.workbench.state import State, from_json
from sdimu_calibration.report.workbench.task_progress import BUSY, TaskProgress
from sdimu_calibration.report.workbench.view import GIVEN, WITH

_SENSORS = 6
"""Channels from here on are measured every second: there is more to see."""
_CHOICES = ("shows", "against", "which")
"""Controls that choose what heat map and residuals show."""
_DRAWN = (Output("heat", "figure"), Output("residuals", "figure"), Output("residuals", "selectedData"))
"""What `_drawn` gives."""


def register(app: Dash, shelf: RecordingCache, doing: TaskProgress) -> None:
    """Make the callbacks."""
    _show_states(app, shelf, doing)
    _draw(app, shelf, doing)
    _show_progress(app, doing)
    _fill_controls(app, shelf)


def _fill_controls(app: Dash, shelf: RecordingCache) -> None:
    """Put estimate and sigma of the coefficient that is chosen into the controls of its prior."""

    @app.callback(
        Output("mean", "value"),
        Output("sigma", "value"),
        Input("coefficient", "value"),
        Kept("shown", "data"),
        prevent_initial_call=True,
    )
    def fill(name: str | None, kept: Any) -> tuple[Any, Any]:
        if not name or not kept:
            return no_update, no_update
        now = from_json(kept)
        bench = shelf.bench(now.recording)
        # A fit that is there is not waited for, whatever the server does meanwhile.
        return tables.edited(bench.known(now.now) or bench.fit(now.now), name)


def _show_states(app: Dash, shelf: RecordingCache, doing: TaskProgress) -> None:
    """Show what follows from a state. Heat map and residuals come with it: the search that follows takes longer."""

    @app.callback(
        Output("about", "children"),
        Output("numbers", "children"),
        Output("ladder", "figure"),
        Output("added", "options"),
        Output("held", "options"),
        Output("held", "value"),
        Output("cut", "children"),
        Output("coefficients", "children"),
        Output("coefficient", "options"),
        Output("models", "children"),
        Output("recording", "options"),
        Output("recording", "value"),
        Output("against", "options"),
        Output("channel", "value"),
        Output("stop", "data"),
        *_DRAWN,
        Output("shown", "data"),
        Output("message", "children", allow_duplicate=True),
        Input("state", "modified_timestamp"),
        Input("look", "data"),
        Kept("state", "data"),
        Kept("page", "data"),
        *(Kept(name, "value") for name in _CHOICES),
        running=BUSY,
        prevent_initial_call="initial_duplicate",
    )
    def show(_when: Any, look: Any, kept: Any, page: Any, *choices: str) -> tuple[Any, ...]:
        if not look:
            return (no_update,) * 20
        now, told = from_json(kept), ""
        tell = doing.teller(str(page))
        try:
            bench = shelf.bench(now.recording)
            bench.fit(now.now, tell)
        except (DataError, UnitError) as error:  # the server was started anew, with other files
            now, told = State(), f"What this page held cannot be shown: {' '.join(str(error).split())}"
            bench = shelf.bench()
        recording = now.recording or shelf.names[0]
        shown = _shown(bench, now, recording, shelf.names, look, tell)
        return (*shown, *_drawn(bench, now, choices, None, look, tell), now.as_json(), told)


def _shown(bench: FitSession, now: State, recording: str, names: list[str], look: Any, tell: Tell) -> tuple[Any, ...]:
    setting = now.now
    rungs = [setting.rung(k) for k in range(len(setting.added) + 1)]
    fits = [bench.fit(rung, tell) for rung in rungs]
    here, given = fits[-1], bench.fit(setting.given, tell)
    channel, stop = cell_of(now, here)
    return (
        of_calibration(here.calibration, recording),
        explained(parts.numbers(here, given)),
        ladder(bench, setting, look, tell),
        [{"label": named(text), "value": text} for text in setting.added],
        [{"label": f"stop {s}", "value": s} for s in bench.stops],
        list(setting.held),
        parts.left_out(setting),
        tables.coefficients(given, here, setting),
        list(here.calibration.names),
        tables.models(bench, [*now.seen, *(r for r in rungs if r not in now.seen)], setting),
        names,
        recording,
        list(here.axes),
        channel,
        stop,
    )


def ladder(bench: FitSession, setting: Setting, look: Any, tell: Tell) -> Any:
    """Draw the ladder of a setting, with its metres where they were worked out."""
    fits = [bench.fit(setting.rung(count), tell) for count in range(len(setting.added) + 1)]
    words = [
        "your priors" if setting.rung(0) != setting.given else "model as given",
        *(f"+ {named(text)}" for text in setting.added),
    ]
    use = bench.known_in_use(setting)
    return figures.finished(figures.ladder(words, [r.held_out for r in fits], [r.at_held for r in fits], use), look)


def cell_of(now: State, fitted: Fitted) -> tuple[int, int]:
    """Channel and stop that a page looks at: those that were clicked, else the worst."""
    if now.cell and 0 <= now.cell[0] < len(fitted.grid.value) and now.cell[1] in fitted.residuals.stop:
        return now.cell
    sizes = np.abs(fitted.grid.value[_SENSORS:])
    row, column = np.unravel_index(np.nanargmax(sizes), sizes.shape)
    return int(row) + _SENSORS, int(fitted.grid.stops[column])


def _draw(app: Dash, shelf: RecordingCache, doing: TaskProgress) -> None:
    """Draw heat map and residuals anew when a choice or the candidate changes."""

    @app.callback(
        *(Output(drawn.component_id, drawn.component_property, allow_duplicate=True) for drawn in _DRAWN),
        *(Input(name, "value") for name in _CHOICES),
        Input("looked", "data"),
        Kept("shown", "data"),
        Kept("look", "data"),
        Kept("page", "data"),
        prevent_initial_call=True,
    )
    def draw(*given: Any) -> tuple[Any, ...]:
        *choices, looked, kept, look, page = given
        if not kept:
            return (no_update,) * len(_DRAWN)
        now, tell = from_json(kept), doing.teller(str(page))
        bench = shelf.bench(now.recording)
        return _drawn(bench, now, choices, looked, look, tell)


def _drawn(
    bench: FitSession, now: State, choices: Sequence[str], looked: str | None, look: Any, tell: Tell
) -> tuple[Any, Any, None]:
    """Heat map and residuals of what was chosen: as given, now, or with the candidate; no point is selected."""
    shows, against, which = choices
    try:
        found = bench.preview(now.now, looked, tell) if looked else None
    except (DataError, UnitError):  # it is in the model now
        found = None
    fitted = bench.fit(now.now.given if shows == GIVEN else now.now, tell)
    channel, stop = cell_of(now, bench.fit(now.now, tell))
    grid, curve = _chosen(fitted, found, shows, str(looked))
    variable = against if against in fitted.axes else next(iter(fitted.axes))
    residuals = figures.residuals(fitted, curve, channel, None if which == "all" else stop, variable)
    heat = figures.heat_map(grid, (channel, stop), figures.most_numbered(look))
    return figures.finished(heat, look), figures.finished(residuals, look), None


def _chosen(fitted: Fitted, found: Preview | None, shows: str, name: str) -> tuple[data.Grid, figures.Curve]:
    """Heat map and residuals, with what the candidate would take out of those of the model that it joins."""
    if shows == GIVEN or found is None:
        return fitted.grid, figures.Curve(fitted.residuals.before)
    if shows == WITH:
        return data.stop_grid(found.residuals, after=True), figures.Curve(found.residuals.after)
    signature = found.residuals.before - found.residuals.after
    return fitted.grid, figures.Curve(fitted.residuals.before, signature, named(name))


def _show_progress(app: Dash, doing: TaskProgress) -> None:
    """Say what the server does for a page."""

    @app.callback(
        Output("busy", "children"), Input("tick", "n_intervals"), Kept("page", "data"), prevent_initial_call=True
    )
    def progress(_count: Any, page: Any) -> Any:
        word, share = doing.at(str(page))
        return [f"{word} \u2026", html.Progress(value=f"{share:.2f}", max="1", **{"aria-label": word})]
