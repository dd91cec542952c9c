"""The first screen: is the model right, what it costs if not, what to do next, how far the error falls, where it fails.

A `FirstScreen` says it in words; the same parts stand on the page of a diagnosis, of a fit and of a set.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from html import escape

import numpy as np

from sdimu_calibration.core.advice import Advice, Kind, Verb
from sdimu_calibration.core.diagnosis.ladder import error_ladder, moved_coefficients
from sdimu_calibration.core.diagnosis.summary import DiagnosisSummary
from sdimu_calibration.core.error_figures import by_hand, held_out, held_out_judged, nis_judged, noise_learned
from sdimu_calibration.core.estimation.second_order_fit import NO_AZIMUTH
from sdimu_calibration.core.joint.set_diagnosis import SetDiagnosis
from sdimu_calibration.core.note import without_advice
from sdimu_calibration.core.plain_text import capital
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.units import from_si
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.report.advice import Spell, advice_html
from sdimu_calibration.report.effect_words import headline_of, title_of
from sdimu_calibration.report.markup import prose
from sdimu_calibration.report.table import with_sigma

GOOD, DOUBTFUL, BAD = "good", "doubtful", "bad"
_MARKS = {GOOD: "\N{CHECK MARK}", DOUBTFUL: "!", BAD: "\N{HEAVY BALLOT X}"}
_WORDS = {GOOD: "The model explains the data", DOUBTFUL: "With reservations", BAD: "The model is wrong"}
_ARROW = " \N{RIGHTWARDS ARROW} "
_IN_WHITE = "in white noise, in which models compare"
"""What an error means that is not in the noise that was learned."""
_WORST = 3
"""Number of coefficients that are named as off, and of pieces of advice that are shown at once."""


@dataclass(frozen=True)
class FirstScreen:
    """What a page says first, in HTML.

    Attributes
    ----------
    tone : str
        ``good``, ``doubtful`` or ``bad``.
    head : str
        The verdict in one sentence.
    costs : tuple of (str, str)
        A figure, and what it is.
    advice : tuple of str
        What to do next, the most useful first.
    remarks : tuple of str
        What a reader must know before the numbers, besides the verdict.
    """

    tone: str
    head: str
    costs: tuple[tuple[str, str], ...] = ()
    advice: tuple[str, ...] = ()
    cost_title: str = field(default="What it costs to ignore it")
    remarks: tuple[str, ...] = ()


def of_diagnosis(summary: DiagnosisSummary, spell: Spell | None = None) -> FirstScreen:
    """Say what a diagnosis found; `spell` makes whole commands of its advice."""
    d = summary.diagnosis
    named = bool(summary.candidates) and d.verdict != Verdict.DATA_FAULT
    doubts = without_advice(d.after.warnings) if d.adequate else ()
    bad = not d.adequate and d.verdict != Verdict.NOISE_MODEL_WRONG
    tone = BAD if bad else GOOD if d.adequate and not doubts else DOUBTFUL
    head = _missing(summary) if named else prose(d.sentence)
    advice: list[Advice | str] = list(dict.fromkeys([*(f.text for f in d.findings), *doubts, *summary.advice]))
    if d.adequate and not advice:
        advice = ["Use the coefficients of this page."]
    if d.adequate and summary.untestable:
        advice.append(_unseen(summary))
    costs = _costs(summary)
    title = "What it costs to ignore it" if summary.found else "How well it predicts"
    told = tuple(advice_html(one, spell) for one in advice)
    unsaid = [text for text in d.noise if named or text not in d.sentence]
    noise = (prose(f"Noise: {'; '.join(unsaid)}."),) if unsaid else ()
    return FirstScreen(tone, head, costs, told, title, (*_remarks(d.after), *noise))


def _remarks(calibration: Calibration) -> tuple[str, ...]:
    """Repeat the note that a fit knows no headings, if it has it."""
    return tuple(prose(capital(note)) + "." for note in calibration.notes if note == NO_AZIMUTH)


def _unseen(summary: DiagnosisSummary) -> str:
    """Say how many effects may be there unseen, and what would show most of them."""
    hidden, most = [one for one in summary.reached if not one.testable], summary.untestable[0]
    names = ", ".join(most.labels[:_WORST]) + (" and others" if len(most.labels) > _WORST else "")
    return (
        f"{len(hidden)} of {len(summary.reached)} effects could not have been seen in this test, and spoil the "
        f"coefficients if they are there: {names} ({most.reason})."
    )


def _missing(summary: DiagnosisSummary) -> str:
    """Name what is missing by families, and what looks the same as the first."""
    found = summary.candidates
    one = len(found) == 1
    size = ""
    if one:
        unit = found[0].candidate.parameter.display_unit
        size = " (" + prose(with_sigma(from_si(found[0].value, unit), from_si(found[0].sigma, unit), unit)) + ")"
    alike = [title_of(name) for name in found[0].alike[:2]] if one else []
    more = f", or what looks the same here: {escape('; '.join(alike))}" if alike else ""
    words = "An equation that the catalogue lacks fits" if summary.diagnosis.own else "Missing in the model"
    return f"{words}: {headline_of(found)}{size}{more}."


def _costs(summary: DiagnosisSummary) -> tuple[tuple[str, str], ...]:
    d, out = summary.diagnosis, []
    rungs = error_ladder(d)
    where = "rests" if d.fit.learns_scatter else "stops"
    values = [f"{value:.2f}" for value in dict.fromkeys((rungs[0][1], rungs[-1][1])) if np.isfinite(value)]
    if noise_learned(d.after):
        out.append(_in_noise(held_out_judged(d.after)))
    if values:
        means = _IN_WHITE if noise_learned(d.after) else "1 is right"
        out.append((_ARROW.join(values), f"sigma: held-out error, at {where} that the fit has not seen; {means}"))
    units = dict(zip(d.before.names, d.before.display_units, strict=True))
    at = {name: k for k, name in enumerate(d.before.names)}
    for name, sigmas in moved_coefficients(d.before, d.after)[:_WORST]:
        off = -sigmas * np.sqrt(d.before.covariance[at[name], at[name]])
        unit = units[name]
        out.append(
            (
                f"{from_si(float(off), unit):+.3g} {unit}".replace("-", "\N{MINUS SIGN}"),
                f"<code>{name}</code> is off without it: {abs(sigmas):.0f} of its sigmas",
            )
        )
    return tuple(out)


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
        tone, head = GOOD, "The model explains the recording as a whole."
    kind = Kind.FIND_EFFECT if tone == BAD else Kind.FIND_SMALLER
    bag = (calibration.origin.recording,) if calibration.origin.recording else ()
    advice: list[Advice | str] = ["Check the IMU file, the site, units and axes."] if grave else []
    advice.append(Advice(kind, (), Verb.DIAGNOSE, bag))
    told = tuple(advice_html(one, spell) for one in advice)
    return FirstScreen(tone, head, costs, told, "How well it predicts", _remarks(calibration))


def _fit_figures(calibration: Calibration) -> tuple[tuple[str, str], ...]:
    error, squared, learned = held_out(calibration), nis_judged(calibration), noise_learned(calibration)
    left_out = "recordings" if calibration.of_set else "rests" if by_hand(calibration) else "stops"
    out = [_in_noise(held_out_judged(calibration))] if learned else []
    if np.isfinite(error):
        means = _IN_WHITE if learned else "1 is right"
        out.append((f"{error:.2f}", f"sigma: held-out error, at {left_out} that the fit has not seen; {means}"))
    if np.isfinite(squared):
        noise = "noise that was learned" if learned else "noise"
        out.append((f"{squared:.3f}", f"NIS: mean squared innovation over what the {noise} explains; 1 is right"))
    return tuple(out)


def of_set(found: SetDiagnosis, spell: Spell | None = None) -> FirstScreen:
    """Say what was found in a set of recordings; `spell` makes whole commands of its advice."""
    tone = GOOD if found.verdict == Verdict.CONSISTENT else BAD
    after = held_out(found.after)
    before = after if found.error_without is None else found.error_without
    values = [f"{value:.2f}" for value in dict.fromkeys((before, after)) if np.isfinite(value)]
    costs = ((_ARROW.join(values), "sigma: held-out error, recordings left out; 1 is right"),) if values else ()
    advice: tuple[Advice | str, ...] = found.advice or ("Nothing: use the coefficients of this page.",)
    told = tuple(advice_html(one, spell) for one in advice)
    title = "What it costs to ignore it" if found.findings else "How well it predicts"
    return FirstScreen(tone, prose(found.sentence), costs, told, title)


def render(first: FirstScreen, *pictures: str) -> str:
    """Return the first screen as HTML; `pictures` stand below the words."""
    costs = "".join(
        f'<li><span class="figure-number">{escape(number)}</span><span>{words}</span></li>'
        for number, words in first.costs
    )
    shown = "".join(f"<li>{text}</li>" for text in first.advice[:_WORST])
    rest = "".join(f"<li>{text}</li>" for text in first.advice[_WORST:])
    more = f"<details><summary>{len(first.advice) - _WORST} more</summary><ul>{rest}</ul></details>" if rest else ""
    return (
        f'<section id="verdict"><h2 class="skip">Verdict</h2><div class="verdict {first.tone}" role="status">'
        f'<p class="head"><span class="mark" aria-hidden="true">{_MARKS[first.tone]}</span> '
        f'<span class="tag">{_WORDS[first.tone]}</span> {first.head}</p>'
        f"{''.join(f'<p>{text}</p>' for text in first.remarks)}</div>"
        f'<div class="columns"><section class="card"><h2>{first.cost_title}</h2>'
        f'<ul class="numbers">{costs}</ul></section>'
        f'<section class="card"><h2>What to do next</h2><ol>{shown}</ol>{more}</section></div>'
        f'<div class="pictures">{"".join(picture for picture in pictures if picture)}</div></section>'
    )
