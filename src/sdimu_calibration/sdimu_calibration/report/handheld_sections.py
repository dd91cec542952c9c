"""Parts of the page on the diagnosis of a handheld run, as HTML text."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.ladder import Rung
from sdimu_calibration.core.diagnosis.problem import Problem
from sdimu_calibration.core.diagnosis.summary import DiagnosisSummary
from sdimu_calibration.core.diagnosis.verdict import shown
from sdimu_calibration.core.evidence.handheld_evidence import HandheldEvidence, places
from sdimu_calibration.core.handheld.handheld_fit import FORCE, RATE, TURN
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report import data, evidence_figures
from sdimu_calibration.report.markup import Draw, grid, quiet, section, sentence
from sdimu_calibration.report.sections import STEP_COLUMNS, step_row
from sdimu_calibration.report.table import with_sigma


def evidence(summary: DiagnosisSummary, draw: Draw) -> list[str]:
    """Tell how the error falls, what is missing and where it shows."""
    return [_ladder(summary, draw), _missing(summary.diagnosis, draw), _where(summary.diagnosis, draw)]


_RUNGS = (
    "model", "estimate", "held-out RMS", "force beyond noise (ug)", "rate beyond noise (deg/s)", "turns (% of angle)",
    "log-likelihood",
)  # fmt: skip


def _ladder(summary: DiagnosisSummary, draw: Draw) -> str:
    d = summary.diagnosis
    names = ["model as given", *(f"+ {r.added}" for r in d.rungs[1:])]
    sizes = ["", *(_size(f.value, f.sigma, f.candidate.parameter.display_unit) for f in summary.found)]
    rows = [
        [
            name, size, f"{r.held_out_rms:.3f}", shown(from_si(_scatter(r)[FORCE], "ug")),
            shown(float(np.degrees(_scatter(r)[RATE]))), shown(100.0 * _scatter(r)[TURN]), f"{r.log_likelihood:.1f}",
        ]
        for name, size, r in zip(names, sizes, d.rungs, strict=True)
    ]  # fmt: skip
    tried = [grid(STEP_COLUMNS, [step_row(step) for step in d.found.steps], {0, 7})] if d.found.steps else []
    return section(
        "Ladder of models: how far the error falls",
        draw(evidence_figures.rungs(names, [r.held_out_rms for r in d.rungs])) if summary.found else "",
        grid(_RUNGS, rows, {0}),
        quiet(
            "Each model has its own fit. Held-out: every rest and the turn to it predicted from the others, in "
            "sigmas of the last model; 1 is right. Beyond noise: scatter of force, rate and turns in addition to white "
            "noise; no data sheet specifies it for a sensor in a hand, so every fit learns it."
        ),
        *tried,
        quiet("Steps are in sigmas of the fit on which they were tried; the missing effect makes these larger.")
        if tried else sentence("No candidate exceeds the scatter: the model stays as it is."),
    )  # fmt: skip


def _size(value: float, sigma: float, unit: str) -> str:
    factor = from_si(1.0, unit)
    return with_sigma(value * factor, sigma * factor, unit)


def _scatter(rung: Rung) -> tuple[float, ...]:
    return rung.scatter or (0.0, 0.0, 0.0)


def _missing(d: Diagnosis, draw: Draw) -> str:
    problem, columns = Problem(d.evidence), range(len(d.evidence.weight), len(d.evidence.names))
    first, last = problem.scan([]), problem.scan([int(c) for c in d.found.chosen])
    entries = data.scores(d.evidence, first, last, columns, d.found.chosen)
    return section(
        "Which effect is missing?",
        draw(evidence_figures.ranking(entries, d.found.threshold)),
        quiet(
            "Each candidate is added to the model alone, everything else is estimated again, in sigmas of the last "
            "model; its size stands at the bar. The dashed line is what the largest of all candidates reaches on pure "
            "noise once in fifty runs. A triangle marks a found effect."
        ),
    )


def _where(d: Diagnosis, draw: Draw) -> str:
    assert isinstance(d.evidence, HandheldEvidence)
    parts = [
        draw(evidence_figures.heat_map(*data.places(d.consistency.where))),
        quiet(
            "Residual of every rate and force at rest, and of the turn to it, model as given, in sigmas of the last "
            "model."
        ),
    ]
    if len(d.found.chosen):
        parts += [
            draw(evidence_figures.heat_map(*data.places(places(d.evidence, d.found.chosen)))),
            quiet("The same with the found effects added."),
        ]
    return section("Where does it fail? Channel by rest", *parts)
