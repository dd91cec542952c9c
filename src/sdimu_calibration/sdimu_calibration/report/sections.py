"""Parts of the page that tell a diagnosis, as HTML text."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from html import escape
from typing import Any

import numpy as np

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.search import Step
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report import data, evidence_figures, residual_figures

Draw = Callable[[Any], str]
"""Makes a part of the page of a figure."""


def section(heading: str, *parts: str) -> str:
    """Return a heading with what belongs to it."""
    return f"<section><h2>{escape(heading)}</h2>\n" + "\n".join(part for part in parts if part) + "</section>"


def quiet(text: str) -> str:
    """Return a remark."""
    return f'<p class="quiet">{escape(text)}</p>'


def verdict(diagnosis: Diagnosis) -> str:
    """Return the verdict in one sentence, what is wrong with data and noise, and the numbers behind it."""
    mark = "\N{CHECK MARK}" if diagnosis.adequate else "\N{HEAVY BALLOT X}"
    kind = "good" if diagnosis.adequate else "bad"
    told = [*(f.text for f in diagnosis.findings), *diagnosis.noise]
    word, sentence = escape(diagnosis.verdict), escape(diagnosis.sentence)
    box = f'<p class="verdict {kind}"><strong>{mark} {word}.</strong> {sentence}</p>'
    listed = "<ul>" + "".join(f"<li>{escape(text)}</li>" for text in told) + "</ul>" if told else ""
    return box + listed + quiet(_numbers(diagnosis))


def _numbers(d: Diagnosis) -> str:
    left, c = d.remainder_after, d.consistency
    words = [
        f"p {_probability(d.p_value)} that a right model looks like this",
        f"free inputs: chi-square {d.remainder_before.chi2:.0f}"
        + (f" -> {left.chi2:.0f}" if len(d.found.chosen) else "")
        + f" of {left.dof} degrees of freedom",
        f"squared innovations {c.nis_mean:.3f} a degree of freedom, {c.first_nis:.2f} in the first second after turns",
        f"white noise over specification: gyro {c.gyro.ratio:.3f}, accelerometer {c.accel.ratio:.3f}",
    ]
    return " \N{MIDDLE DOT} ".join(words) + "."


def _probability(p: float) -> str:
    return f"= {p:.2g}" if p > 1e-300 else "< 1e-300"


_LADDER = (
    "step", "estimate", "|z| (noise reaches)", "log-likelihood gain", "log Bayes factor", "held-out RMS",
    "held-out gain", "verdict",
)  # fmt: skip


def ladder(diagnosis: Diagnosis, draw: Draw) -> str:
    """Return the ladder of models: what each step gains, which coefficients it moves, why the last was refused."""
    steps = diagnosis.found.steps
    if not steps:
        return section("Ladder of models", "<p>No candidate stands out of the noise: the model stays as given.</p>")
    first = ["model as given", "", "", "", "", f"{steps[0].held_out_before.rms:.3f}", "", ""]
    told = [item for step in steps for item in _told(step)]
    figure = evidence_figures.ladder(diagnosis)
    return section(
        "Ladder of models: how far the error falls",
        draw(figure),
        grid(_LADDER, [first, *(_rung(step) for step in steps)], {0, 7}),
        "<ul>" + "".join(f"<li>{escape(text)}</li>" for text in told) + "</ul>",
        quiet(
            "Held-out: every stop predicted from the others, in sigmas; 1 is right. In-sample likelihood rises with "
            "every parameter, this does not. The verdict's held-out error leaves out every third stop at once and is "
            "larger. Estimates are those of the step, with all before it."
        ),
    )


def _rung(step: Step) -> list[str]:
    factor = from_si(1.0, step.display_unit)
    return [
        f"+ {step.label}", f"{step.estimate * factor:.4g} \u00b1 {step.sigma * factor:.2g} {step.display_unit}",
        f"{abs(step.z):.1f} ({step.threshold:.1f})", f"{step.log_likelihood_gain:.1f}", f"{step.log_bayes_factor:.1f}",
        f"{step.held_out_before.rms:.3f} \u2192 {step.held_out_after.rms:.3f}",
        f"{step.held_out_gain:.1f} \u00b1 {step.held_out_error:.1f}",
        "accepted" if step.accepted else f"refused: {step.reason}",
    ]  # fmt: skip


def _told(step: Step) -> list[str]:
    moved = ", ".join(f"{name} by {size:+.1f} sigma" for name, size in step.moved if abs(size) >= 0.5)
    out = [f"{step.label}, while missing, pulled {moved}."] if moved and step.accepted else []
    if step.alike:
        out.append(f"Nothing in these data tells {step.label} from {', '.join(step.alike[:6])}.")
    return out


def missing(diagnosis: Diagnosis, entries: Sequence[data.Scored], draw: Draw) -> str:
    """Return the ranking of missing effects, and how well what was found fits."""
    parts = data.explained(diagnosis)
    fits = [draw(evidence_figures.explained(parts))] if parts else []
    if parts:
        fits.append(
            quiet("Misfit against what the effect predicts, everything else estimated along: on the line, it is right.")
        )
    return section(
        "Which effect is missing?",
        draw(evidence_figures.ranking(entries, diagnosis.found.threshold)),
        quiet(
            "Each candidate added to the model alone, all coefficients estimated again; beside each bar its size. "
            "The dashed line is what the largest of all candidates reaches on pure noise once in fifty tests. "
            "A triangle marks what was found."
        ),
        *fits,
    )


def where(diagnosis: Diagnosis, found: data.Residuals, draw: Draw) -> str:
    """Return the heat maps of normalised residual means."""
    two = bool(len(diagnosis.found.chosen))
    parts = [
        draw(evidence_figures.heat_map(data.where(diagnosis.consistency))),
        quiet(
            "Mean innovation of each channel at each stop over its own sigma, model as given, predicted second by "
            "second as the test went on. Standard normal when the model is right: of 200 cells, one beyond 3 is chance."
        ),
    ]
    if two:
        parts += [
            draw(evidence_figures.heat_map(data.stop_grid(found, after=True))),
            quiet("The same with what was found added: residuals of the fit."),
        ]
    return section("Where does it fail? Channel by stop", *parts)


def residuals(diagnosis: Diagnosis, found: data.Residuals, draw: Draw) -> str:
    """Return residuals in time, against physical variables, and as free inputs."""
    two = bool(len(diagnosis.found.chosen))
    marks = (
        "Orange triangles: model as given. Blue dots: with what was found added."
        if two
        else "Triangles: model as given."
    )
    return "\n".join([
        section(
            "Innovations in time", draw(residual_figures.innovations(found, two)),
            quiet(
                f"Measured minus predicted, all coefficients at their final values. Grey: three sigma. {marks} "
                "Position and velocity are measured in the first second after a turn; of rate and force, one "
                "second each, the marks are means over stops."
            ),
        ),
        section(
            "Residuals against physical variables",
            draw(residual_figures.against_variables(found, data.variables(diagnosis), two)),
            quiet(
                "At rest: binned means with their standard errors, in sigmas of one second. "
                f"a: specific force, w: body rate, dT: temperature since the start. {marks}"
            ),
        ),
        section(
            "The sensor error that each stop and turn would need",
            draw(residual_figures.free_inputs(data.free_inputs(diagnosis), two)),
            quiet(
                "A constant error of its own for every dwell (plain) and turn (hatched), the smallest that fits. "
                "A star: its score alone is beyond three sigma. Dots: with what was found added."
            ),
        ),
    ])  # fmt: skip


def separation(calibration: Calibration, draw: Draw) -> str:
    """Return the correlation matrix with the hardest pairs in words."""
    names, C = data.correlation(calibration)
    pairs = [f"{a} and {b}: {c:+.2f}" for a, b, c in data.hardest_pairs(names, C)]
    words = (
        "Hardest to separate: " + "; ".join(pairs) + "." if pairs else "No two coefficients are correlated beyond 0.5."
    )
    return section("What is hard to separate", f"<p>{escape(words)}</p>", draw(evidence_figures.correlation(names, C)))


_SMALLEST = ("effect", "smallest that would be found", "unit", "usual size", "share of signature left", "testable here")


def smallest(entries: Sequence[data.Scored]) -> str:
    """Return the minimal detectable sizes: what this test could have seen, the worst axis of each effect."""
    worst: dict[str, data.Scored] = {}
    for entry in entries:
        if entry.family != "own" and entry.smallest >= worst.get(entry.family, entry).smallest:
            worst[entry.family] = entry
    order = sorted(worst.values(), key=lambda e: (np.isfinite(e.smallest), -e.smallest / e.prior))
    rows = [_seen(entry) for entry in order]
    blind = sum(row[-1] != "yes" for row in rows)
    return section(
        "What could have been seen",
        f"<p>Of {len(rows)} effects, {blind} could not have been seen on every axis at their usual size.</p>",
        f"<details><summary>Table of minimal detectable sizes</summary>{grid(_SMALLEST, rows, {0, 2, 5})}</details>",
        quiet(
            "Worst axis of each effect. Found with 80 % power at a false-alarm rate of 0.001; usual: one sigma of this "
            "grade of IMU."
        ),
    )


def _seen(entry: data.Scored) -> list[str]:
    if not np.isfinite(entry.smallest):
        size, answer = "", "no: the model's coefficients take all of it"
    else:
        size = f"{entry.smallest:.3g}"
        answer = "yes" if entry.smallest <= entry.prior else "only when unusually large"
    usual = f"{entry.prior:.3g}" if np.isfinite(entry.prior) else ""
    return [entry.label, size, entry.unit, usual, f"{100 * entry.retention:.1f} %", answer]


def grid(columns: Sequence[str], rows: Sequence[Sequence[str]], text: set[int]) -> str:
    """Return an HTML table; the columns in `text` are flush left."""

    def line(tag: str, words: Sequence[str]) -> str:
        kinds = (' class="text"' if k in text else "" for k in range(len(words)))
        return (
            "<tr>"
            + "".join(f"<{tag}{kind}>{escape(word)}</{tag}>" for word, kind in zip(words, kinds, strict=True))
            + "</tr>"
        )

    body = "".join(line("td", row) for row in rows)
    return f'<div class="wide"><table><thead>{line("th", columns)}</thead><tbody>{body}</tbody></table></div>'
