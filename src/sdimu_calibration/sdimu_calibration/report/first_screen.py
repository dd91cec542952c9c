"""The first screen: is the model right, what it costs if not, what to do next, how far the error falls, where it fails.

A `FirstScreen` says it in words; the same parts stand on the page of a diagnosis, of a fit and of a set.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from sdimu_calibration.core.advice import Advice, Kind, Verb
from sdimu_calibration.core.diagnosis.grades import name_of
from sdimu_calibration.core.diagnosis.ladder import error_ladder
from sdimu_calibration.core.diagnosis.summary import DiagnosisSummary
from sdimu_calibration.core.error_figures import held_out, held_out_judged, is_handheld, nis, nis_judged, noise_learned
from sdimu_calibration.core.estimation.azimuth_words import NO_AZIMUTH
from sdimu_calibration.core.estimation.fit_words import MISFIT
from sdimu_calibration.core.estimation.free_inertial import FOUND
from sdimu_calibration.core.evidence.testable import UNSEEN
from sdimu_calibration.core.note import without_advice
from sdimu_calibration.core.plain_text import capital, first_of
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.report.advice import Spell, advice_html
from sdimu_calibration.report.cost import (
    OVER_MODELS,
    TOO_LARGE,
    InUse,
    Off,
    coefficients_off,
    in_use,
    metres,
    wrong_without,
)
from sdimu_calibration.report.effect_words import tip
from sdimu_calibration.report.glossary import explained
from sdimu_calibration.report.markup import grid, prose, quiet, signs
from sdimu_calibration.report.report_extras import ReportExtras, of_navigations

if TYPE_CHECKING:  # a result of one recording has none: fifty modules less to load
    from sdimu_calibration.core.joint.set_diagnosis import SetDiagnosis

GOOD, DOUBTFUL, BAD = "good", "doubtful", "bad"
_MARKS = {GOOD: "\N{CHECK MARK}", DOUBTFUL: "!", BAD: "\N{HEAVY BALLOT X}"}
_WORDS = {GOOD: "The model explains the data", DOUBTFUL: "With reservations", BAD: "The model is wrong"}
_ARROW = " \N{RIGHTWARDS ARROW} "
_IN_WHITE = "in white noise, in which models compare"
"""What an error means that is not in the noise that was learned."""
_COSTS, _PREDICTS = "What it costs to ignore it", "How well it predicts"
_LEAD = 40
"""Number of characters up to which the words before a colon say how sure a statement is: more are a clause of it."""
_WORST = 3
"""Number of coefficients that are named as off, and of pieces of advice that are shown at once."""


@dataclass(frozen=True)
class FirstScreen:
    """What a page says first, in HTML."""

    tone: str
    """``good``, ``doubtful`` or ``bad``."""
    head: str
    """The verdict in one sentence."""
    costs: tuple[tuple[str, str], ...] = ()
    """A figure, and what it is."""
    advice: tuple[str, ...] = ()
    """What to do next, the most useful first."""
    cost_title: str = _COSTS
    remarks: tuple[str, ...] = ()
    """What a reader must know before the numbers, besides the verdict."""
    tag: str = ""
    """The verdict in a few words; empty for those of the tone."""
    ladder: str = ""
    """Models with their errors, above the costs."""
    off: str = ""
    """Coefficients that are wrong without what was found, below the ladder."""


def of_diagnosis(
    summary: DiagnosisSummary, spell: Spell | None = None, more: ReportExtras | None = None
) -> FirstScreen:
    """Say what a diagnosis found; `spell` makes whole commands of its advice, `more` says what it costs in metres."""
    d = summary.diagnosis
    doubts = without_advice(d.after.warnings) if d.adequate else ()
    tone, tag = _judged(summary, bool(doubts))
    advice: list[Advice | str] = list(dict.fromkeys([*(f.text for f in d.findings), *doubts, *summary.advice]))
    if d.adequate and not advice:
        advice = ["Use the coefficients of this page."]
    if summary.untestable and (d.adequate or summary.candidates):
        advice.append(_unseen(summary))
    title = _COSTS if summary.found else _PREDICTS
    told = tuple(advice_html(one, spell) for one in advice)
    said = summary.diagnosis.sentence
    unsaid = [text for text in d.noise if text not in said]
    noise = (prose(f"Noise: {'; '.join(unsaid)}."),) if unsaid else ()
    remarks = (*_remarks(d.after), *noise)
    off = _off_table(wrong_without(summary, more)[:_WORST])
    ladder = ladder_strip(summary, more)
    return FirstScreen(tone, _head(summary), _costs(summary, more), told, title, remarks, tag, ladder, off)


def _judged(summary: DiagnosisSummary, doubts: bool) -> tuple[str, str]:
    """Tone of the page, and the word for it."""
    d = summary.diagnosis
    if d.verdict == Verdict.DATA_FAULT:
        return BAD, "The data have a fault"
    if summary.candidates or d.verdict == Verdict.CLASS_OF_EFFECTS:
        return DOUBTFUL, "Something is missing in the model"
    if d.verdict == Verdict.NOISE_MODEL_WRONG:
        return DOUBTFUL, "The noise is not as stated"
    if not d.adequate:
        return BAD, _WORDS[BAD]
    tone = DOUBTFUL if doubts or held_out_judged(d.after) > MISFIT else GOOD
    return tone, _WORDS[tone]


def _head(summary: DiagnosisSummary) -> str:
    """Verdict as HTML, a line a grade, the equation of each effect that was found under its name."""
    html = _in_lines(summary.diagnosis.statements)
    for one in summary.candidates:
        words = name_of(one)
        shown = tip(words, one.candidate.effect, [one.candidate.label])
        html = html.replace(escape(words), shown, 1)
    return html


def _in_lines(statements: Sequence[str]) -> str:
    """Return statements as HTML, a line each; none ends between a number and its sigma or its per cent."""
    html = "".join(f'<span class="grade">{_led(one)}</span>' for one in statements)
    html = html.replace("(-", "(\N{MINUS SIGN}")
    return html.replace(" \N{PLUS-MINUS SIGN} ", "\u00a0\N{PLUS-MINUS SIGN}\u00a0").replace(" %", "\u00a0%")


def _led(statement: str) -> str:
    """Return a statement with the words before its colon, how sure it is, in bold."""
    lead, colon, rest = statement.partition(": ")
    return f"<strong>{prose(lead)}:</strong> {prose(rest)}" if colon and len(lead) <= _LEAD else prose(statement)


def _remarks(calibration: Calibration) -> tuple[str, ...]:
    """Repeat the note that a fit knows no headings, if it has it."""
    return tuple(prose(capital(note)) + "." for note in calibration.notes if note == NO_AZIMUTH)


def _unseen(summary: DiagnosisSummary) -> str:
    """Say how many effects may be there unseen, and what would show most of them."""
    hidden, most = [one for one in summary.reached if not one.testable], summary.untestable[0]
    names = first_of(most.labels, _WORST)
    return (
        f"{len(hidden)} of {len(summary.reached)} candidates {UNSEEN} in this test, and spoil the "
        f"coefficients if they are there: {names} ({most.reason})."
    )


def _costs(summary: DiagnosisSummary, more: ReportExtras | None) -> tuple[tuple[str, str], ...]:
    """Say the error in noise that was learned; of a model that lacks nothing metres and the held-out error."""
    d, out = summary.diagnosis, []
    rungs = error_ladder(d)
    if len(rungs) < 2:
        out += _metres(more)
    if noise_learned(d.after):
        out.append(_in_noise(held_out_judged(d.after)))
    if len(rungs) < 2 and np.isfinite(rungs[0][1]):
        where = "rests" if d.fit.learns_scatter else "stops"
        means = _IN_WHITE if noise_learned(d.after) else "1 is right"
        out.append((f"{rungs[0][1]:.2f}", f"sigma: held-out error, at {where} that the fit has not seen; {means}"))
    return tuple(out)


def _metres(more: ReportExtras | None) -> list[tuple[str, str]]:
    """Say how far a navigation without aid drifts; nothing where there is none."""
    use = in_use(more)
    return [] if use is None else [(use.figures.replace(" -> ", _ARROW), escape(use.words))]


_OFF = ("coefficient", "value", "wrong by", "unit", "in sigmas")
"""Headings of the coefficients that are wrong: the last two are of what is wrong."""


def _off_table(worst: Sequence[Off], sigma: str = OVER_MODELS) -> str:
    """Return the coefficients that are wrong without what was found: the better value, and by how much; or nothing.

    `sigma`: what stands behind the sign.
    """
    if not worst:
        return ""
    rows = [[one.name, signs(one.better), signs(one.alone), one.unit, f"{abs(one.sigmas):.1f}"] for one in worst]
    told = f"{TOO_LARGE}; \N{PLUS-MINUS SIGN}: {sigma}."
    return grid(_OFF, rows, {0, 3}) + quiet(told)


def _in_noise(error: float) -> tuple[str, str]:
    return f"{error:.2f}", "sigma: held-out error in the noise that was learned, a stop left out at a time; 1 is right"


def of_fit(calibration: Calibration, spell: Spell | None = None) -> FirstScreen:
    """Say whether a fit fits; what is missing is for a diagnosis to say. `spell` makes whole commands of advice."""
    grave, doubts = calibration.not_to_be_trusted, calibration.warnings
    costs = _fit_figures(calibration)
    if grave:
        tone, head = BAD, f"Not to be trusted: {prose(grave[0])}."
    elif misfit := without_advice(calibration.misfits):
        tone, head = BAD, prose(capital(misfit[0])) + "."
    elif doubts:
        tone, head = DOUBTFUL, prose(capital(doubts[0])) + "."
    else:
        tone, head = GOOD, "The model explains the recording as a whole; small effects were not looked for."
    kind = Kind.FIND_EFFECT if tone == BAD else Kind.FIND_SMALLER
    bag = (calibration.origin.recording,) if calibration.origin.recording else ()
    advice: list[Advice | str] = ["Check the IMU file, the site, units and axes."] if grave else []
    advice.append(Advice(kind, (), Verb.DIAGNOSE, bag))
    told = tuple(advice_html(one, spell) for one in advice)
    return FirstScreen(tone, head, costs, told, _PREDICTS, _remarks(calibration))


def _fit_figures(calibration: Calibration) -> tuple[tuple[str, str], ...]:
    learned = noise_learned(calibration) and not _stands_for_an_effect(calibration)
    error, squared = held_out(calibration), nis_judged(calibration) if learned else nis(calibration)
    left_out = "recordings" if calibration.of_set else "rests" if is_handheld(calibration) else "stops"
    out = [_in_noise(held_out_judged(calibration))] if learned else []
    if np.isfinite(error):
        means = _IN_WHITE if learned else "1 is right"
        out.append((f"{error:.2f}", f"sigma: held-out error, at {left_out} that the fit has not seen; {means}"))
    if np.isfinite(squared):
        noise = "noise that was learned" if learned else "noise"
        out.append((f"{squared:.3f}", f"NIS: mean squared innovation over what the {noise} explains; 1 is right"))
    return tuple(out)


def _stands_for_an_effect(calibration: Calibration) -> bool:
    """Whether noise was learned in the place of what is missing: in it everything is right, and nothing is."""
    right = all(not figure > MISFIT for figure in (held_out_judged(calibration), nis_judged(calibration)))
    return bool(calibration.misfits) and noise_learned(calibration) and right


def of_set(found: SetDiagnosis, spell: Spell | None = None) -> FirstScreen:
    """Say what was found in a set of recordings; `spell` makes whole commands of its advice."""
    more, rungs = of_navigations(found.ladder), found.ladder.errors
    off = coefficients_off(found.before, found.after) if found.findings else ()
    costs = []
    if len(rungs) < 2:
        costs += _metres(more)
        error = held_out(found.after)
        if np.isfinite(error):
            costs.append((f"{error:.2f}", "sigma: held-out error, recordings left out; 1 is right"))
    holds = ", which hold what was found" if found.findings else ""
    advice: tuple[Advice | str, ...] = found.advice or (f"Use the coefficients of this page{holds}.",)
    told = tuple(advice_html(one, spell) for one in advice)
    tone, tag = set_judged(found)
    title = _COSTS if found.findings else _PREDICTS
    # Where the search went to and fro the coefficients are those of the joint fit.
    worst = _off_table(off[:_WORST], OVER_MODELS if found.probabilities else "one sigma of the joint fit")
    ladder = _strip(rungs, more, _RIGHT.format("recordings"))
    return FirstScreen(tone, _in_lines(found.statements), tuple(costs), told, title, tag=tag, ladder=ladder, off=worst)


def set_judged(found: SetDiagnosis) -> tuple[str, str]:
    """Tone of what is said of a set, and the word for it."""
    if found.verdict == Verdict.CONSISTENT:
        tone = DOUBTFUL if held_out(found.after) > MISFIT else GOOD
        return tone, _WORDS[tone]
    if found.verdict == Verdict.UNEXPLAINED:
        return BAD, _WORDS[BAD]
    if found.verdict == Verdict.DATA_FAULT:
        return BAD, "One recording is unlike the others"
    return DOUBTFUL, "Something is missing in the model"


def render(first: FirstScreen, *pictures: str) -> str:
    """Return the first screen as HTML; `pictures` stand below the words."""
    costs = "".join(
        f'<li><span class="figure-number">{escape(number)}</span><span>{words}</span></li>'
        for number, words in first.costs
    )
    what = first.ladder + first.off + (f'<ul class="numbers">{costs}</ul>' if costs else "")
    shown = "".join(f"<li>{text}</li>" for text in first.advice[:_WORST])
    rest = "".join(f"<li>{text}</li>" for text in first.advice[_WORST:])
    more = f"<details><summary>{len(first.advice) - _WORST} more</summary><ul>{rest}</ul></details>" if rest else ""
    return (
        f'<section id="verdict"><h2 class="skip">Verdict</h2><div class="verdict {first.tone}" role="status">'
        f'<p class="head"><span class="mark" aria-hidden="true">{_MARKS[first.tone]}</span> '
        f'<span class="tag">{first.tag or _WORDS[first.tone]}</span></p><p class="said">{first.head}</p>'
        f"{''.join(f'<p>{text}</p>' for text in first.remarks)}</div>"
        f'<div class="columns"><section class="card"><h2>{first.cost_title}</h2>'
        f"{explained(what)}</section>"
        f'<section class="card"><h2>What to do next</h2><ol>{shown}</ol>{more}</section></div>'
        f'<div class="pictures">{"".join(picture for picture in pictures if picture)}</div></section>'
    )


HELD_OUT = "held-out error (sigma)"
_RIGHT = "Held-out error: at {} that the fit has not seen; 1 is right."
_WHITE = (
    "Held-out error: at {} that the fit has not seen, in white noise, in which models compare: what was learned as "
    "noise counts as error here."
)


def ladder_strip(summary: DiagnosisSummary, more: ReportExtras | None) -> str:
    """Return the ladder of a diagnosis; empty where there is one model."""
    d = summary.diagnosis
    where = "rests" if d.fit.learns_scatter else "stops"
    return _strip(error_ladder(d), more, (_WHITE if noise_learned(d.after) else _RIGHT).format(where))


def _strip(rungs: Sequence[tuple[str, float]], more: ReportExtras | None, means: str) -> str:
    """Return a line for each model, the simplest first, and what the numbers are; empty where there is one model.

    `rungs`: names and held-out errors; `means`: what these are.
    """
    if len(rungs) < 2:
        return ""
    use = in_use(more)
    rows = [_line(name, k, len(rungs), error, use) for k, (name, error) in enumerate(rungs)]
    columns, told = ["model", HELD_OUT], [means]
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
    key = FOUND if place == models - 1 else name
    return [name, metres(distance[key]) if key in distance else "", held_out]
