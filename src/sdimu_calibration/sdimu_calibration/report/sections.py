"""Parts of the page on a diagnosis, as HTML text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

import numpy as np

from sdimu_calibration.core.advice import Kind
from sdimu_calibration.core.diagnosis.advice import Untestable
from sdimu_calibration.core.diagnosis.assumed import Assumed
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.found import TOLD_AS, DetectableSize, Found
from sdimu_calibration.core.diagnosis.grades import NAMED, named, percents_of
from sdimu_calibration.core.diagnosis.ladder import Rung, figures_in_words
from sdimu_calibration.core.diagnosis.step import Step
from sdimu_calibration.core.diagnosis.summary import DiagnosisSummary
from sdimu_calibration.core.evidence.consistency import Consistency
from sdimu_calibration.core.evidence.testable import UNSEEN, WORST_SENSOR
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.plain_text import capital, three
from sdimu_calibration.core.probability import in_percent
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.units import from_si
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.report import data, evidence_figures, measured, measured_figures, residual_figures
from sdimu_calibration.report.advice import Spell, advice_html
from sdimu_calibration.report.effect_words import effect_of_key, families, family_words, tip
from sdimu_calibration.report.markup import Draw, folded, grid, prose, quiet, section, sentence, signs, switched
from sdimu_calibration.report.may_be import classes_of
from sdimu_calibration.report.report_extras import ReportExtras
from sdimu_calibration.report.table import with_sigma

_UNUSUAL = 0.05
"""Probability (1) below which a right model is unusual: one in twenty."""


def numbers(d: Diagnosis) -> str:
    """Return the numbers behind a verdict in one line."""
    left, c = d.free_inputs_after, d.consistency
    if d.fit.learns_scatter:
        return f"p {_probability(d.p_value)} that a right model has a candidate as large as the largest."
    white = " in white noise" if d.found.noise else ""
    # Beside an effect that was found, a p of 1 says nothing: its score is what speaks.
    right = [f"p {_probability(d.p_value)} that a right model{white} looks like this"]
    words = [
        *(right if d.p_value < _UNUSUAL or not d.found.chosen.size else []),
        f"free inputs: chi-square {d.free_inputs_before.chi2:.0f}"
        + (f" -> {left.chi2:.0f}" if len(d.found.chosen) else "")
        + f" of {left.dof} degrees of freedom",
        f"squared innovations{' in white noise' if d.found.noise else ''} {c.nis_mean:.3f} a degree of freedom, "
        f"{c.first_nis:.2f} in the first second after turns",
        f"white noise over specification: gyro {c.gyro.ratio:.3f}, accelerometer {c.accel.ratio:.3f}",
    ]
    return " \N{MIDDLE DOT} ".join(words) + "."


def _probability(p: float) -> str:
    return f"= {p:.2g}" if p > 1e-300 else "< 1e-300"


STEP_COLUMNS = (
    "step",
    "estimate",
    "|z| (noise reaches)",
    "log-likelihood gain",
    "log Bayes factor",
    "held-out log score",
)


def ladder(diagnosis: Diagnosis) -> str:
    """Return what was found, one at a time: what each gains, which coefficients it moves."""
    steps = diagnosis.found.steps
    if not steps:
        return sentence(_no_step(diagnosis))
    told = [item for step in steps for item in _told(step)]
    return (
        grid(STEP_COLUMNS, [step_row(step) for step in steps], {0})
        + "<ul>"
        + "".join(f"<li>{prose(text)}</li>" for text in told)
        + "</ul>"
        + quiet(
            "Estimates are those of the step, with all before it. Log score: gain in the predictive density of stops "
            "left out one at a time, over all stops; in-sample likelihood rises with every parameter, this does not."
        )
    )


def _no_step(diagnosis: Diagnosis) -> str:
    """Say why there is no ladder: nothing to add, or nothing was asked to be added (the workbench scores only)."""
    standing = int(np.sum(np.abs(diagnosis.found.first.z) > diagnosis.found.threshold))
    if standing and not diagnosis.adequate:
        return f"Nothing was added to this model; {standing} of the candidates below stand out of the noise."
    if diagnosis.verdict == Verdict.CLASS_OF_EFFECTS:
        return "Nothing was added to this model: no effect by itself is likely enough."
    return "No candidate stands out of the noise: the model stays as it is."


_REFITS = (
    "model",
    "log-likelihood",
    "log Bayes factor",
    "NIS",
    "held-out RMS",
    "velocity after turns",
    "held-out RMS falls",
    "moved most (sigma)",
)


def refits(rungs: Sequence[Rung], noise: Sequence[NoiseTerm]) -> str:
    """Return the ladder of real refits; nothing when the model was not grown. `noise`: that the diagnosis found."""
    if not rungs:
        return ""
    return grid(_REFITS, [_refit(rung) for rung in rungs], {0, 6, 7}) + quiet(
        f"Each model is fitted to the whole recording. {capital(figures_in_words(rungs, noise))}. "
        "Velocity after turns: RMS of the first second of each stop. Moved: value less that of the model above, in "
        "sigmas of the latter."
    )


def _refit(r: Rung) -> list[str]:
    moved = ", ".join(f"{name} {size:+.1f}" for name, size in r.moved[:3])
    return [
        r.name,
        f"{r.log_likelihood:.1f}",
        f"{r.log_bayes_factor:+.1f}" if r.added else "",
        f"{r.nis_mean:.3f}",
        f"{r.held_out_rms:.3f}",
        f"{r.jump:.2f} sigma, {1e3 * r.jump_velocity:.2f} mm/s",
        ("yes" if r.accepted else "no") if r.added else "",
        moved,
    ]


def step_row(step: Step) -> list[str]:
    """Return a step of the search as a row of `STEP_COLUMNS`."""
    factor = from_si(1.0, step.display_unit)
    return [
        f"+ {step.label}",
        with_sigma(step.estimate * factor, step.sigma * factor, step.display_unit),
        f"{abs(step.z):.1f} ({step.threshold:.1f})",
        f"{step.log_likelihood_gain:.1f}",
        f"{step.log_bayes_factor:.1f}",
        f"{step.held_out_gain:+.0f} \u00b1 {step.held_out_error:.0f}",
    ]


def _told(step: Step) -> list[str]:
    moved = ", ".join(f"{name} by {size:+.1f}" for name, size in step.moved if abs(size) >= 0.5)
    out = [f"{step.label}, once it is in the model, moves {moved} of the sigmas in white noise."] if moved else []
    if step.alike:
        out.append(f"These data cannot separate {step.label} from {', '.join(step.alike[:6])}.")
    return out


def effects(summary: DiagnosisSummary, entries: Sequence[data.Scored], draw: Draw) -> str:
    """Return what was found with sizes, how each was found, and every candidate that was looked at."""
    d = summary.diagnosis
    parts = data.explained(d)
    fits = (
        [
            draw(evidence_figures.explained(parts)),
            quiet("Misfit against the prediction of each effect, all else estimated with it: on the line it is right."),
        ]
        if parts
        else []
    )
    return section(
        "Effects: what is missing, how large",
        sentence(summary.diagnosis.sentence),
        found_table(summary),
        *fits,
        folded(
            "Every candidate, added alone",
            draw(evidence_figures.ranking(entries, d.found.threshold, classes_of(summary.found, d.probabilities))),
            quiet(
                "All coefficients are estimated again with it; its size stands at the bar. The dashed line is what the "
                "largest of all candidates reaches on pure noise once in fifty tests. A triangle marks a found effect; "
                "what looks the same shares its bar and its line of names. Behind its size stands how probable it is "
                "that one of these is missing; under the mouse each has its own probability."
            ),
        ),
        folded("Steps of the search", ladder(d)),
        folded("Ladder of refits: one effect at a time", refits(d.rungs, d.found.noise)) if d.rungs else "",
        quiet(numbers(d)),
    )


_FOUND = ("effect", "coefficient", "size", "probability", "z", "log Bayes factor")
_HELD_OUT = "held-out error"
"""Only refits of one effect at a time know it: without them there is no such column."""


def found_table(summary: DiagnosisSummary) -> str:
    """Return the effects that were found by families, the largest first."""
    if not summary.found:
        return sentence(_no_step(summary.diagnosis))
    refitted = any(np.isfinite((one.held_out_before, one.held_out_after)).all() for one in summary.found)
    lines = []
    for group in families(summary.found):
        for k, one in enumerate(group):
            unit = one.candidate.parameter.display_unit
            size = with_sigma(from_si(one.value, unit), from_si(one.sigma, unit), unit)
            fall = (one.held_out_before, one.held_out_after)
            cells = (
                size,
                _own_share(one),
                signs(f"{one.z:+.1f}"),
                f"{one.log_bayes_factor:.0f}",
                *([f"{fall[0]:.3f} \u2192 {fall[1]:.3f}" if np.isfinite(fall).all() else ""] if refitted else ()),
            )
            name = f'<td class="text">{family_words(group) if not k else ""}</td>'
            label = f'<td class="text"><code>{escape(one.candidate.label)}</code></td>'
            lines.append(f"<tr>{name}{label}{''.join(f'<td>{escape(text)}</td>' for text in cells)}</tr>")
    words = (*_FOUND, _HELD_OUT) if refitted else _FOUND
    head = "".join(f'<th scope="col"{" class=text" if k < 2 else ""}>{word}</th>' for k, word in enumerate(words))
    tried = "" if summary.candidates else sentence("Tried, but not enough to explain the misfit:")
    body = "".join(lines)
    return f'{tried}<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def _own_share(one: Found) -> str:
    """Probability, in words, that it is this very coefficient; that of its class where it has no others."""
    alone = in_percent(one.probability) if np.isfinite(one.probability) else ""
    return percents_of(one.may_be).get(one.candidate.coefficient, alone)


_AT_STAKE = 3
"""Number of coefficients that are named as hanging on a choice, of those that move and of those known less well."""
_TELLS_APART = {Kind.RECORD_ONCE_MORE, Kind.NO_TURN_TELLS, Kind.NO_PLAN_TELLS, Kind.TELL_APART, Kind.RANK_TURNS}


def confused(summary: DiagnosisSummary, spell: Spell | None = None) -> str:
    """Return what each found effect would be confused with, what hangs on it, and what would tell; empty if nothing."""
    rows = []
    for one in summary.found:
        if not one.alike and not one.together:
            continue
        shares = {name: f" {text}" for name, text in percents_of(one.may_be).items()}
        # Time constants of one coefficient share its probability: it stands once.
        alike = {name.partition("(")[0]: name for name in reversed(one.alike)}
        others = "; ".join(
            # The probability is that of the coefficient with any time constant: so its name is, too.
            tip(named(coefficient), effect_of_key(name), [coefficient]) + shares.get(coefficient, "")
            for coefficient, name in list(reversed(alike.items()))[:6]
            if coefficient != one.candidate.coefficient
        )
        pairs = "; ".join(
            f"<code>{escape(first)}</code> with <code>{escape(second)}</code> together {in_percent(p)}"
            for first, second, p in one.together[:3]
            if p >= NAMED
        )
        others = "; ".join(part for part in (others, pairs) if part)
        if not others:
            continue
        moved = [
            f"with {s.other} instead, {s.coefficient} moves by {s.sigmas:+.1f} of its sigmas"
            for s in one.coefficient_shifts[:_AT_STAKE]
        ]
        wider = [
            f"the sigma of {name} is {factor:.1f} times what it would be if this were known to be "
            f"{one.candidate.coefficient}"
            for name, factor in one.widened[:_AT_STAKE]
        ]
        stake = "; ".join([*moved, *wider])
        rows.append(
            f'<tr><td class="text"><code>{escape(one.candidate.label)}</code></td><td class="text">{others}</td>'
            f'<td class="text">{prose(stake) or "nothing that matters"}</td></tr>'
        )
    if not rows:
        return ""
    told = [one for one in summary.advice if one.kind in _TELLS_APART]
    return section(
        "What it would be confused with",
        '<div class="wide"><table class="words"><thead><tr><th class="text" scope="col">found</th>'
        '<th class="text" scope="col">looks the same in these data</th><th class="text" scope="col">what hangs on it'
        f"</th></tr></thead><tbody>{''.join(rows)}</tbody></table></div>",
        *(f"<p>{advice_html(one, spell)}</p>" for one in told),
    )


def heat_maps(diagnosis: Diagnosis, draw: Draw) -> str:
    """Return the heat map of the model as given and of that with what was found, one scale, one at a time."""
    fits = [diagnosis.fit, diagnosis.extended] if len(diagnosis.found.chosen) else [diagnosis.fit]
    if diagnosis.fit.learns_scatter:
        return ""
    caption = caption_of_map(bool(diagnosis.found.noise), diagnosis.unexplained)
    return heat_map_card([fit.consistency() for fit in fits], draw, caption)


_CELL = "A cell is the mean innovation of a channel at a stop, over its sigma"


def caption_of_map(learned: bool, misfit: bool) -> str:
    """Say what a cell of a heat map is, and when it counts.

    `learned`: noise with a memory was, which is not in the sigma of a cell; `misfit`: the model does not fit, so that
    this noise stands for what is missing.
    """
    if not learned:
        return f"{_CELL}. It counts beyond {data.NOTABLE:.0f}: of 200 cells, one is chance."
    if misfit:
        why = "the noise that was learned stands for what is missing, and excuses no cell"
        return f"{_CELL} in white noise. It counts beyond {data.NOTABLE:.0f}: {why}."
    why = "The noise that was learned makes cells larger, too: here the verdict counts, and no cell by itself"
    return f"{_CELL} in white noise. {why}."


def heat_map_card(found: Sequence[Consistency], draw: Draw, caption: str) -> str:
    """Return a card with the heat map of each check, one at a time."""
    figure = evidence_figures.heat_maps([data.where(one) for one in found])
    return (
        '<section class="card"><h2>Where it fails: channel by stop</h2>'
        + switched(draw(figure), ("model as given", "with what was found")[: len(found)])
        + quiet(caption)
        + "</section>"
    )


_MARKS = "Orange triangles: model as given. Blue dots: with the found effects added."


def residuals(diagnosis: Diagnosis, found: data.Residuals, more: ReportExtras, draw: Draw) -> str:
    """Return measured against predicted, residuals in time and against physical variables, and free inputs."""
    two = bool(len(diagnosis.found.chosen))
    marks = _MARKS if two else "Triangles: model as given."
    return section(
        "Residuals",
        draw(residual_figures.innovations(found, two)),
        quiet(
            f"Measured minus predicted, all coefficients at their final values. Grey: three sigma. {marks} "
            "Position and velocity are measured in the first second after a turn; of rate and force, one "
            "second each, the marks are means over stops and the thin line keeps the extremes."
        ),
        folded(
            "Measured against predicted",
            draw(measured_figures.overlay(measured.overlay(diagnosis, found))),
            quiet(
                "Rate and force: means over each stop of the readings, and the prediction of the model"
                f"{' with the found effects' if two else ''}. Position and velocity: navigation with the model as "
                "given after each turn, where the truth is rest, and the prediction of "
                f"{'the found effects' if two else 'the model'}."
            ),
        ),
        _variables(diagnosis, found, more, two, marks, draw),
        folded(
            "The sensor error that each stop and turn would need",
            draw(residual_figures.free_inputs(data.free_inputs(diagnosis), two)),
            quiet(
                "A constant error of its own for every dwell (plain) and turn (hatched), the smallest that fits. "
                "A star: its score alone is beyond three sigma. Dots: with the found effects added."
            ),
        ),
    )


def _variables(
    diagnosis: Diagnosis, found: data.Residuals, more: ReportExtras, two: bool, marks: str, draw: Draw
) -> str:
    """Residuals against what could cause them: motion, then time, temperature and table, then turns."""
    values, names = data.variables(diagnosis), list(data.VARIABLES)
    if more.table is not None:
        epochs = diagnosis.navigation.prepared.epochs
        values = np.column_stack([values, measured.table_angles(more.table, 0.5 * (epochs.start + epochs.end))])
        names += [(name.replace("_", " "), "deg") for name in more.table.names]
    parts = [
        draw(figure)
        for columns in (range(6), range(6, len(names)))
        if (figure := residual_figures.against_variables(found, values, names, columns, two)) is not None
    ]
    turned = measured.jumps(diagnosis, found)
    if len(turned.angle):
        parts.append(draw(measured_figures.jumps(turned, two)))
    return folded(
        "Residuals against physical variables",
        *parts,
        quiet(
            "At rest: binned means with their standard errors, in sigmas of one second. a: specific force, w: body "
            f"rate, dT: temperature since the start; angles of the table are shown and never used. {marks} After "
            "turns: innovation of velocity in the first second, against the angle turned about each body axis."
        ),
    )


def separation(calibration: Calibration, draw: Draw) -> str:
    """Return the correlation matrix with the hardest pairs in words."""
    names, C = data.correlation(calibration)
    pairs = [f"{a} and {b}: {c:+.2f}" for a, b, c in data.hardest_pairs(names, C)]
    words = (
        "Hardest to separate: " + "; ".join(pairs) + "." if pairs else "No two coefficients are correlated beyond 0.5."
    )
    return f"<p>{escape(words)}</p>{draw(evidence_figures.correlation(names, C))}"


_SMALLEST = ("effect", "size told in 80 % of tests", "unit", "usual size", "share of signature left", "testable here")


def smallest(
    reached: Sequence[DetectableSize], assumed: Sequence[Assumed] = (), untestable: Sequence[Untestable] = ()
) -> str:
    """Return the minimal detectable sizes: what this test could have seen, the worst axis of each effect.

    `untestable`: why effects could not have been seen.
    """
    worst: dict[str, DetectableSize] = {}
    for entry in reached:
        if entry.smallest >= worst.get(entry.family, entry).smallest:
            worst[entry.family] = entry
    order = sorted(worst.values(), key=lambda e: (np.isfinite(e.smallest), -e.smallest / e.prior))
    why = {label: group.reason for group in untestable for label in group.labels}
    rows = [_seen(entry, why) for entry in order]
    unseen, never = sum(row[-1] != "yes" for row in rows), sum(row[-1].startswith("no") for row in rows)
    return section(
        "What could have been seen",
        f"<p>Of {len(rows)} effects, {unseen} have an axis on which they could not have been seen at their usual size, "
        f"{never} of these one on which they {UNSEEN}.</p>",
        f"<details><summary>Table of the sizes that are told</summary>{grid(_SMALLEST, rows, {0, 2, 5})}</details>",
        _taken_for_granted(assumed),
        quiet(
            f"Worst axis of each effect. Of tests with an effect of this size and nothing else missing, 80 % tell it: "
            f"{TOLD_AS}. Usual: one sigma of this grade of IMU."
        ),
    )


_ASSUMED = (
    "coefficient",
    "takes for granted that there is no",
    "size it may have",
    "unit",
    "the coefficient is off then",
)


def _taken_for_granted(assumed: Sequence[Assumed]) -> str:
    """Return for each coefficient the effect that would move it most, were it there; nothing where none matters."""
    if not assumed:
        return ""
    rows = [
        [a.coefficient, a.label, three(from_si(a.size, a.display_unit)), a.display_unit, f"{a.sigmas:.1f} sigma"]
        for a in assumed
    ]
    told = (
        f"The sigmas of {len(rows)} coefficients hold only if an effect is absent that this test shows weakly or not "
        "at all."
    )
    table = f"<details><summary>What each takes for granted</summary>{grid(_ASSUMED, rows, {0, 1, 3})}</details>"
    return f"<p>{told}</p>{table}"


def _seen(entry: DetectableSize, why: Mapping[str, str]) -> list[str]:
    """Return a row of `_SMALLEST`. `why`: reasons by label, those that the terminal and diagnosis.json give."""
    size = three(from_si(entry.smallest, entry.display_unit))
    answer = "yes" if entry.smallest <= entry.prior else "only when unusually large"
    if not np.isfinite(entry.smallest) or entry.smallest > WORST_SENSOR * entry.prior:
        size, answer = "", ": ".join(word for word in ("no", why.get(entry.label, "")) if word)
    usual = three(from_si(entry.prior, entry.display_unit)) if np.isfinite(entry.prior) else ""
    return [entry.label, size, entry.display_unit, usual, f"{100 * entry.retention:.1f} %", answer]
