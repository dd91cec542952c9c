"""The application of the live page: one callback that fetches what is new to a page, one that adds an effect."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from dash import Dash, Input, Output, no_update
from dash import State as Kept

from sdimu_calibration.core.data_error import DataError
from sdimu_calibration.report.live_page import figures, parts, view
from sdimu_calibration.report.live_page.record import (
    ANSWER,
    CHOICES,
    CURVES,
    DIAGNOSIS,
    HEAD,
    PARTS,
    STOPS,
    LiveRecord,
    LiveView,
)
from sdimu_calibration.report.live_page.visitors import Visitors
from sdimu_calibration.report.workbench.dash_page import application
from sdimu_calibration.report.workbench.elements import explained
from sdimu_calibration.report.workbench.guard import LOOPBACK

_RUN, _LOOK = "run", "look"
"""What a page knows beside the versions of the parts: which test it is of, and how its figures look."""


def build(record: LiveRecord, host: str = LOOPBACK[0], visitors: Visitors | None = None) -> Dash:
    """Make the application of a record, to be served at an address of this machine.

    `visitors`: where pages are noted.
    """
    app = application("sdimu live", host, view.STYLE, view.SCRIPT)
    app.layout = lambda: view.layout(record.folder, record.about)
    _follow(app, record, visitors or Visitors())
    _add(app, record)
    return app


def _head(now: LiveView, _look: Any) -> tuple[Any, ...]:
    end = now.head.end
    shown = parts.ended(end) if end else []
    return (
        parts.place(now.head),
        "" if end else explained(now.head.light),
        shown,
        parts.end_class(end),
        end is not None,
        bool(end),
    )


def _curves(now: LiveView, look: Any) -> tuple[Any, ...]:
    drawn = figures.sigmas(now.curves, now.fallen) if now.curves.t else figures.nothing("no estimate yet")
    return figures.finished(drawn, look), " ".join(filter(None, (parts.largest(now), parts.joined(now))))


def _stops(now: LiveView, look: Any) -> tuple[Any, ...]:
    drawn = figures.nis_map(now.nis) if now.nis else figures.nothing("no innovations yet")
    return (figures.finished(drawn, look),)


def _diagnosis(now: LiveView, look: Any) -> tuple[Any, ...]:
    seen = now.diagnosis
    heat = figures.heat_map(seen) if seen.stops else figures.nothing("no diagnosis yet")
    fell = figures.errors(now.errors) if now.errors else figures.nothing("no diagnosis yet")
    return (
        *parts.verdict(now),
        figures.finished(heat, look),
        figures.finished(fell, look),
        parts.candidates(now),
        parts.options(seen),
    )


def _choices(now: LiveView, _look: Any) -> tuple[Any, ...]:
    return (parts.choices(now.choices),)


def _answer(now: LiveView, _look: Any) -> tuple[Any, ...]:
    return (now.answer,)


_SHOWN: Mapping[str, tuple[Callable[[LiveView, Any], tuple[Any, ...]], tuple[Output, ...]]] = {
    HEAD: (
        _head,
        (
            Output("place", "children"),
            Output("light", "children"),
            Output("ended", "children"),
            Output("ended", "className"),
            Output("tick", "disabled"),
            Output("add", "disabled"),
        ),
    ),
    CURVES: (_curves, (Output("sigmas", "figure"), Output("joined", "children"))),
    STOPS: (_stops, (Output("nis", "figure"),)),
    DIAGNOSIS: (
        _diagnosis,
        (
            Output("verdict", "children"),
            Output("verdict", "className"),
            Output("heat", "figure"),
            Output("errors", "figure"),
            Output("candidates", "children"),
            Output("candidate", "options"),
        ),
    ),
    CHOICES: (_choices, (Output("choices", "children"),)),
    ANSWER: (_answer, (Output("answer", "children"),)),
}
"""What makes each part of the page, and where it stands."""


def _follow(app: Dash, record: LiveRecord, visitors: Visitors) -> None:
    """Fetch what is new to a page at each tick."""

    @app.callback(
        Output("known", "data"),
        *(output for part in PARTS for output in _SHOWN[part][1]),
        Input("tick", "n_intervals"),
        Input("look", "data"),
        Kept("known", "data"),
        Kept("page", "data"),
    )
    def follow(_count: Any, look: Any, known: Any, page: Any) -> tuple[Any, ...]:
        if not look:
            return (no_update,) * (1 + sum(len(outputs) for _, outputs in _SHOWN.values()))
        now, knows = record.view(), known if isinstance(known, dict) else {}
        visitors.came(str(page), now.head.end is not None)
        fresh = knows.get(_RUN) != now.run or knows.get(_LOOK) != look
        shown: list[Any] = []
        for part in PARTS:
            make, outputs = _SHOWN[part]
            new = fresh or knows.get(part) != now.versions[part]
            shown += make(now, look) if new else (no_update,) * len(outputs)
        return {_RUN: now.run, _LOOK: look, **now.versions}, *shown


def _add(app: Dash, record: LiveRecord) -> None:
    """Ask the test for the effect that was chosen; its answer comes with a later tick."""

    @app.callback(
        Output("message", "children"), Input("add", "n_clicks"), Kept("candidate", "value"), prevent_initial_call=True
    )
    def add(_clicks: Any, chosen: Any) -> str:
        if not chosen:
            raise DataError("choose an effect first: click one of the list, or search the catalogue")
        record.ask(str(chosen))
        return ""
