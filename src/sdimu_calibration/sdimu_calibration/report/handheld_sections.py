"""Parts of the page that tell the diagnosis of a hand-held run, as HTML text."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sdimu_calibration.core.diagnosis.handheld_summary import HandheldSummary, Place, shown
from sdimu_calibration.core.evidence.handheld_evidence import CHANNELS
from sdimu_calibration.core.handheld.handheld_fit import FORCE, RATE, TURN
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report import data, evidence_figures
from sdimu_calibration.report.markup import Draw, grid, prose, quiet, section, sentence
from sdimu_calibration.report.sections import STEP_COLUMNS, step_row, verdict_box
from sdimu_calibration.report.table import with_sigma


def verdict(told: HandheldSummary) -> str:
    """Return the verdict in one sentence, what to do, and the number behind it."""
    d = told.diagnosis
    listed = "<ul>" + "".join(f"<li>{prose(text)}</li>" for text in told.advice) + "</ul>" if told.advice else ""
    return (
        verdict_box(d.adequate, d.verdict, told.sentence) + listed
        + quiet(f"p = {d.p_value:.2g} that a right model has a candidate as large as the largest.")
    )  # fmt: skip


def evidence(told: HandheldSummary, draw: Draw) -> list[str]:
    """Tell how the error falls, what is missing and where it shows."""
    return [_ladder(told, draw), _missing(told, draw), _where(told, draw)]


_RUNGS = (
    "model", "estimate", "held-out RMS", "force beyond noise (ug)", "rate beyond noise (deg/s)", "turns (% of the way)",
    "log-likelihood",
)  # fmt: skip


def _ladder(told: HandheldSummary, draw: Draw) -> str:
    d = told.diagnosis
    names = ["model as given", *(f"+ {r.added}" for r in d.rungs[1:])]
    sizes = ["", *(_size(f.value, f.sigma, f.candidate.parameter.display_unit) for f in told.found)]
    rows = [
        [
            name, size, f"{r.held_out:.3f}", shown(from_si(float(r.extra[FORCE]), "ug")),
            shown(float(np.degrees(r.extra[RATE]))), shown(100.0 * float(r.extra[TURN])), f"{r.log_likelihood:.1f}",
        ]
        for name, size, r in zip(names, sizes, d.rungs, strict=True)
    ]  # fmt: skip
    tried = [grid(STEP_COLUMNS, [step_row(step) for step in d.steps], {0, 7})] if d.steps else []
    return section(
        "Ladder of models: how far the error falls",
        draw(evidence_figures.rungs(names, [r.held_out for r in d.rungs])) if told.found else "",
        grid(_RUNGS, rows, {0}),
        quiet(
            "Every model fitted anew. Held-out: every rest and the way to it predicted from the others, in sigmas of "
            "the last model; 1 is right. Beyond noise: what force, rate and turns miss by, white noise taken off; "
            "nobody specifies it for a sensor in a hand, so every fit learns it."
        ),
        *tried,
        quiet("Steps in sigmas of the fit that they were tried on, which the missing effect makes larger.")
        if tried else sentence("No candidate stands out of the scatter: the model stays as it is."),
    )  # fmt: skip


def _size(value: float, sigma: float, unit: str) -> str:
    factor = from_si(1.0, unit)
    return with_sigma(value * factor, sigma * factor, unit)


def _missing(told: HandheldSummary, draw: Draw) -> str:
    d = told.diagnosis
    columns = range(len(d.evidence.weight), len(d.evidence.names))
    entries = data.scores(d.evidence, told.first, told.last, columns, d.chosen)
    return section(
        "Which effect is missing?",
        draw(evidence_figures.ranking(entries, d.threshold)),
        quiet(
            "Each candidate added to the model alone, all else estimated again, in sigmas of the last model; beside "
            "each bar its size. The dashed line is what the largest of all candidates reaches on pure noise once in "
            "fifty runs. A triangle marks what was found."
        ),
    )


def _where(told: HandheldSummary, draw: Draw) -> str:
    parts = [
        draw(evidence_figures.heat_map(*_grid(told.where))),
        quiet(
            "Residual of every rate and force at rest, and of the way to it, over its own sigma, model as given, in "
            "sigmas of the last model."
        ),
    ]
    if told.found:
        parts += [
            draw(evidence_figures.heat_map(*_grid(told.after))),
            quiet("The same with what was found added."),
        ]
    return section("Where does it fail? Channel by rest", *parts)


def _grid(places: Sequence[Place]) -> tuple[data.Grid, list[str]]:
    """Lay out residuals; channels that nothing checks, as the heading by which a turn ends, are left out."""
    stops = np.unique([p.stop for p in places]).astype(np.int64)
    channels = [c for c in CHANNELS if any(p.channel == c for p in places)]
    value = np.full((len(channels), len(stops)), np.nan)
    for place in places:
        value[channels.index(place.channel), np.searchsorted(stops, place.stop)] = place.normalised
    return data.Grid(stops, value), channels
