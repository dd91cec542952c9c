"""The callback that judges all recordings of a set as one unit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from dash import Dash, Input, Output, html, no_update
from dash import State as Kept

from sdimu_calibration.core.joint.set_diagnosis import SetDiagnosis
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import UnitError, from_si
from sdimu_calibration.report.first_screen import set_judged
from sdimu_calibration.report.table import with_sigma
from sdimu_calibration.report.workbench.elements import table
from sdimu_calibration.report.workbench.state import from_json
from sdimu_calibration.report.workbench.task_progress import BUSY, TaskProgress
from sdimu_calibration.storage.files.advice_words import sentence

Judge = Callable[[Sequence[str], Callable[[str, float], None]], SetDiagnosis]


def register(app: Dash, judge: Judge, doing: TaskProgress) -> None:
    """Make the callback; what `judge` takes is the same as for `app.build`."""

    @app.callback(
        Output("judged", "children"),
        Output("message", "children", allow_duplicate=True),
        Input("judge", "n_clicks"),
        Kept("state", "data"),
        Kept("page", "data"),
        running=BUSY,
        prevent_initial_call=True,
    )
    def joint(_clicks: Any, kept: Any, page: Any) -> tuple[Any, str]:
        setting = from_json(kept).now
        try:
            if setting.priors or setting.held or setting.cut or any("\n" in text for text in setting.added):
                raise DataError(
                    "a set takes the effects of the catalogue only: put back what was left out, remove priors and "
                    "effects of your own, or judge this recording by itself"
                )
            found = judge(setting.added, doing.teller(str(page)))
        except (DataError, UnitError) as error:
            return no_update, f"Not done: {' '.join(str(error).split())}"
        return shown(found), ""


def shown(found: SetDiagnosis) -> list[Any]:
    """Show the joint verdict, every effect that was found, and the advice."""
    rows = [
        [
            f.label,
            f.recording or "all",
            with_sigma(from_si(f.value, f.display_unit), from_si(f.sigma, f.display_unit), f.display_unit),
            f"{f.z:+.1f}",
            ", ".join(f.alike) or "nothing",
        ]
        for f in found.findings
    ]
    heads = ("effect", "in", "size", "score", "looks the same")
    return [
        html.P(f"{found.verdict}: {found.sentence}", className=f"verdict {set_judged(found)[0]}"),
        *([table(heads, rows)] if rows else []),
        *(html.P(f"Advice: {sentence(one)}") for one in found.advice),
    ]
