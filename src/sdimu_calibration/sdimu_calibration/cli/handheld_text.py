"""The diagnosis of a hand-held run in the terminal: the verdict first, then where, what, how far the error fell."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sdimu_calibration.cli.diagnosis_text import amount, line, smallest
from sdimu_calibration.cli.wide_table import print_table
from sdimu_calibration.core.diagnosis.handheld_summary import beyond

if TYPE_CHECKING:
    from rich.console import Console

    from sdimu_calibration.core.diagnosis.handheld_summary import HandheldSummary

_TOP = 5


def print_handheld_summary(console: Console, told: HandheldSummary) -> None:
    """Print everything that a diagnosis by hand has to say."""
    d = told.diagnosis
    line(console, told.sentence)
    line(console, f"p of the model as given: {d.p_value:.2g}")
    if not d.adequate:
        places = ", ".join(f"{w.channel} at rest {w.stop} ({w.normalised:+.1f} sigma)" for w in told.where[:_TOP])
        line(console, f"worst: {places}")
    for number, s in enumerate(d.steps, start=1):
        line(
            console,
            f"step {number}: {s.label} (z {s.z:+.1f} in the scatter of the run, threshold {s.threshold:.1f}) {s.fate}",
        )
    if told.found:
        _found(console, told)
    _ladder(console, told)
    hidden = sum(not r.testable for r in told.reached)
    line(console, f"{hidden} of {len(told.reached)} candidates could not have been seen in this run")
    if d.adequate:
        line(console, f"smallest sizes that would have been found (80 %): {smallest(told.reached)}")
    for text in told.advice:
        line(console, f"advice: {text}")


def _found(console: Console, told: HandheldSummary) -> None:
    rows = []
    for f in told.found:
        unit = f.candidate.parameter.display_unit
        rows.append(
            [
                f.candidate.label, amount(f.value, unit, 4), amount(f.sigma, unit, 2), unit, f"{f.z:+.1f}",
                f"{100 * f.explained:.0f} %", ", ".join(f.alike[:4]),
            ]
        )  # fmt: skip
    print_table(console, ("effect", "estimate", "+-", "unit", "z", "explains", "looks the same here"), rows, "found")


def _ladder(console: Console, told: HandheldSummary) -> None:
    rows = [
        [f"+ {r.added}" if r.added else "as given", f"{r.log_likelihood:.1f}", f"{r.held_out:.3f}", beyond(r.extra)]
        for r in told.diagnosis.rungs
    ]
    print_table(console, ("model", "log-likelihood", "held-out", "beyond white noise"), rows, "ladder of fits")
