"""The ladder of models in short: each model with its metres in use and its error at stops that were held out."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.diagnosis.ladder import error_ladder
from sdimu_calibration.core.diagnosis.summary import DiagnosisSummary
from sdimu_calibration.core.error_figures import noise_learned
from sdimu_calibration.report.cost import InUse, in_use, metres
from sdimu_calibration.report.markup import grid, quiet
from sdimu_calibration.report.report_extras import ReportExtras

HELD_OUT = "held-out error (sigma)"
_RIGHT = "Held-out error: at {} that the fit has not seen; 1 is right."
_WHITE = (
    "Held-out error: at {} that the fit has not seen, in white noise, in which models compare: what was learned as "
    "noise counts as error here."
)


def ladder_strip(summary: DiagnosisSummary, more: ReportExtras | None) -> str:
    """Return a line for each model, the simplest first, and what the numbers are; empty where there is one model."""
    d, use = summary.diagnosis, in_use(more)
    rungs = error_ladder(d)
    if len(rungs) < 2:
        return ""
    rows = [_line(name, k, len(rungs), error, use) for k, (name, error) in enumerate(rungs)]
    columns = ["model", HELD_OUT]
    where = "rests" if d.fit.learns_scatter else "stops"
    told = [(_WHITE if noise_learned(d.after) else _RIGHT).format(where)]
    if use is not None:
        columns.insert(1, f"position after {use.minutes:.0f} min")
        rows.insert(0, [use.names[0], metres(use.distance[0]), ""])
        told.insert(0, f"Position without aid, over {use.where} that no fit has seen{use.expected}.")
    return grid(columns, rows, {0}) + quiet(" ".join(told))


def _line(name: str, place: int, models: int, error: float, use: InUse | None) -> list[str]:
    """Return a model: what it is, metres, held-out error."""
    held_out = f"{error:.3f}" if np.isfinite(error) else ""
    if use is None:
        return [name, held_out]
    distance = dict(zip(use.names, use.distance, strict=True))
    # Of the models between, no navigation was tried.
    key = "model as given" if not place else "with what was found" if place == models - 1 else ""
    return [name, metres(distance[key]) if key in distance else "", held_out]
