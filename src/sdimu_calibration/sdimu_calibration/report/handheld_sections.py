"""Parts of the page on the diagnosis of a handheld run, as HTML text."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.diagnosis.ladder import Rung
from sdimu_calibration.core.diagnosis.problem import Problem
from sdimu_calibration.core.diagnosis.summary import DiagnosisSummary
from sdimu_calibration.core.diagnosis.verdict import shown
from sdimu_calibration.core.evidence.handheld_evidence import HandheldEvidence, places
from sdimu_calibration.core.handheld.run_scatter import FORCE, RATE, TURN
from sdimu_calibration.core.units import from_si
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.report import data, evidence_figures
from sdimu_calibration.report.markup import Draw, grid, quiet, section, sentence, switched
from sdimu_calibration.report.may_be import classes_of
from sdimu_calibration.report.sections import STEP_COLUMNS, found_table, step_row
from sdimu_calibration.report.table import with_sigma


def evidence(summary: DiagnosisSummary, draw: Draw) -> list[str]:
    """Tell how the error falls, what is missing and where it shows."""
    return [_missing(summary, draw), _ladder(summary)]


_RUNGS = (
    "model",
    "estimate",
    "held-out RMS",
    "force beyond noise (ug)",
    "rate beyond noise (deg/s)",
    "turns (% of angle)",
    "log-likelihood",
)


def _ladder(summary: DiagnosisSummary) -> str:
    d = summary.diagnosis
    names = ["model as given", *(f"+ {r.added}" for r in d.rungs[1:])]
    sizes = ["", *(_size(f.value, f.sigma, f.candidate.parameter.display_unit) for f in summary.found)]
    rows = [
        [
            name,
            size,
            f"{r.held_out_rms:.3f}",
            shown(from_si(_scatter(r)[FORCE], "ug")),
            shown(float(np.degrees(_scatter(r)[RATE]))),
            shown(100.0 * _scatter(r)[TURN]),
            f"{r.log_likelihood:.1f}",
        ]
        for name, size, r in zip(names, sizes, d.rungs, strict=True)
    ]
    tried = [grid(STEP_COLUMNS, [step_row(step) for step in d.found.steps], {0})] if d.found.steps else []
    return section(
        "Ladder of models",
        grid(_RUNGS, rows, {0}),
        quiet(
            "Each model has its own fit. Held-out: every rest and the turn to it predicted from the others, in "
            "sigmas of the last model; 1 is right. Beyond noise: scatter of force, rate and turns in addition to white "
            "noise; no data sheet specifies it for a sensor in a hand, so every fit learns it. Its log-likelihood is "
            "the one with this scatter."
        ),
        *tried,
        quiet("Steps are in sigmas of the fit on which they were tried; the missing effect makes these larger.")
        if tried
        else sentence(
            "Nothing was added to this model: no effect by itself is likely enough."
            if d.verdict == Verdict.CLASS_OF_EFFECTS
            else "No candidate exceeds the scatter: the model stays as it is."
        ),
    )


def _size(value: float, sigma: float, unit: str) -> str:
    factor = from_si(1.0, unit)
    return with_sigma(value * factor, sigma * factor, unit)


def _scatter(rung: Rung) -> tuple[float, ...]:
    return rung.scatter or (0.0, 0.0, 0.0)


def _missing(summary: DiagnosisSummary, draw: Draw) -> str:
    d = summary.diagnosis
    problem, columns = Problem(d.evidence), range(len(d.evidence.weight), len(d.evidence.names))
    first, last = problem.scan([]), problem.scan([int(c) for c in d.found.chosen])
    entries = data.scores(d.evidence, first, last, columns, d.found.chosen)
    return section(
        "Effects: what is missing, how large",
        found_table(summary),
        draw(evidence_figures.ranking(entries, d.found.threshold, classes_of(summary.found, d.probabilities))),
        quiet(
            "Each candidate is added to the model alone, everything else is estimated again, in sigmas of the last "
            "model; its size stands at the bar. The dashed line is what the largest of all candidates reaches on pure "
            "noise once in fifty runs. A triangle marks a found effect; behind its size stands how probable it is."
        ),
    )


def heat_maps(summary: DiagnosisSummary, draw: Draw) -> str:
    """Return a card with the residuals by rest, of the model as given and with what was found, one at a time."""
    d = summary.diagnosis
    assert isinstance(d.evidence, HandheldEvidence)
    found = [data.places(d.consistency.where)]
    if len(d.found.chosen):
        found.append(data.places(places(d.evidence, d.found.chosen)))
    figure = evidence_figures.heat_maps([grid for grid, _ in found], found[0][1], "rest")
    return (
        '<section class="card"><h2>Where it fails: channel by rest</h2>'
        + switched(draw(figure), ("model as given", "with what was found")[: len(found)])
        + quiet("Residual of rate and force at each rest, and of the turn to it, in sigmas of the last model.")
        + "</section>"
    )
