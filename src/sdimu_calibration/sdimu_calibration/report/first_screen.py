"""The first screen: is the model right, what it costs if not, what to do next, how far the error falls, where it fails.

A `Verdict` says it in words; the same parts stand on the page of a diagnosis, of a fit and of a set.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from html import escape

import numpy as np

from sdimu_calibration.core.diagnosis.ladder import error_ladder, moved_coefficients
from sdimu_calibration.core.diagnosis.summary import DiagnosisSummary
from sdimu_calibration.core.error_figures import by_hand, held_out, nis
from sdimu_calibration.core.joint.set_diagnosis import SetDiagnosis
from sdimu_calibration.core.results import Calibration, without_advice
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.advice import Spell, advice_html
from sdimu_calibration.report.effect_words import headline_of, title_of
from sdimu_calibration.report.markup import prose
from sdimu_calibration.report.table import with_sigma

GOOD, DOUBTFUL, BAD = "good", "doubtful", "bad"
_MARKS = {GOOD: "\N{CHECK MARK}", DOUBTFUL: "!", BAD: "\N{HEAVY BALLOT X}"}
_WORDS = {GOOD: "The model explains the data", DOUBTFUL: "With reservations", BAD: "The model is wrong"}
_ARROW = " \N{RIGHTWARDS ARROW} "
_WORST = 3
"""Number of coefficients that are named as off, and of pieces of advice that are shown at once."""



@dataclass(frozen=True)
class Verdict:
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
    cost_title : str
    """

    tone: str
    head: str
    costs: tuple[tuple[str, str], ...] = ()
    advice: tuple[str, ...] = ()
    cost_title: str = field(default="What it costs to ignore it")


def of_diagnosis(summary: DiagnosisSummary, spell: Spell | None = None) -> Verdict:
    """Say what a diagnosis found; `spell` makes whole commands of its advice."""
    d = summary.diagnosis
    named = bool(summary.candidates) and d.verdict != "data fault"
    doubts = without_advice(d.after.warnings) if d.adequate else ()
    bad = not d.adequate and d.verdict != "noise model wrong"
    tone = BAD if bad else GOOD if d.adequate and not doubts else DOUBTFUL
    head = _missing(summary) if named else prose(d.sentence)
    advice = list(dict.fromkeys([*(f.text for f in d.findings), *doubts, *summary.advice, *d.noise]))
    if d.adequate and not advice:
        advice = ["Use the coefficients of this page."]
    if d.adequate and summary.untestable:
        advice.append(_unseen(summary))
    costs = _costs(summary)
    title = "What it costs to ignore it" if summary.found else "How well it predicts"
    return Verdict(tone, head, costs, tuple(advice_html(text, spell) for text in advice), title)


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
    if values:
        out.append((_ARROW.join(values), f"sigma: held-out error, at {where} that the fit has not seen; 1 is right"))
    units = dict(zip(d.before.names, d.before.display_units, strict=True))
    at = {name: k for k, name in enumerate(d.before.names)}
    for name, sigmas in moved_coefficients(d.before, d.after)[:_WORST]:
        off = -sigmas * np.sqrt(d.before.covariance[at[name], at[name]])
        unit = units[name]
        out.append((
            f"{from_si(float(off), unit):+.3g} {unit}".replace("-", "\N{MINUS SIGN}"),
            f"<code>{name}</code> is off without it: {abs(sigmas):.0f} of its sigmas",
        ))  # fmt: skip
    return tuple(out)


def of_fit(calibration: Calibration, spell: Spell | None = None) -> Verdict:
    """Say whether a fit fits; what is missing is for a diagnosis to say. `spell` makes whole commands of advice."""
    grave, doubts = calibration.not_to_be_trusted, calibration.warnings
    costs = _fit_figures(calibration)
    if grave:
        tone, head = BAD, f"Not to be trusted: {prose(grave[0])}."
    elif misfit := [line for line in doubts if "sdimu diagnose" in line]:
        tone, head = BAD, prose(_capital(misfit[0].partition("; run")[0])) + "."
    elif doubts:
        tone, head = DOUBTFUL, prose(_capital(doubts[0])) + "."
    else:
        tone, head = GOOD, "The model explains the recording as a whole."
    bag = "BAG" if spell else calibration.origin.recording or "BAG"
    says = f"Find {'which effect is missing' if tone == BAD else 'out whether smaller effects are missing'}"
    advice = [*(["Check the IMU file, the site, units and axes."] if grave else []), f"{says}: sdimu diagnose {bag}"]
    told = tuple(advice_html(text, spell) for text in advice)
    return Verdict(tone, head, costs, told, "How well it predicts")


def _fit_figures(calibration: Calibration) -> tuple[tuple[str, str], ...]:
    error, squared = held_out(calibration), nis(calibration)
    left_out = "recordings" if calibration.of_set else "rests" if by_hand(calibration) else "stops"
    out = []
    if np.isfinite(error):
        out.append((f"{error:.2f}", f"sigma: held-out error, at {left_out} that the fit has not seen; 1 is right"))
    if np.isfinite(squared):
        out.append((f"{squared:.3f}", "NIS: mean squared innovation over what the noise explains; 1 is right"))
    return tuple(out)


def of_set(found: SetDiagnosis, spell: Spell | None = None) -> Verdict:
    """Say what was found in a set of recordings; `spell` makes whole commands of its advice."""
    tone = GOOD if found.verdict == "consistent" else BAD
    before, after = held_out(found.before), held_out(found.after)
    values = [f"{value:.2f}" for value in dict.fromkeys((before, after)) if np.isfinite(value)]
    costs = ((_ARROW.join(values), "sigma: held-out error, recordings left out; 1 is right"),) if values else ()
    advice = found.advice or ("Nothing: use the coefficients of this page.",)
    told = tuple(advice_html(text, spell) for text in advice)
    title = "What it costs to ignore it" if found.findings else "How well it predicts"
    return Verdict(tone, prose(found.sentence), costs, told, title)


def render(verdict: Verdict, *pictures: str) -> str:
    """Return the first screen as HTML; `pictures` stand below the words."""
    costs = "".join(
        f'<li><span class="figure-number">{escape(number)}</span><span>{words}</span></li>'
        for number, words in verdict.costs
    )
    shown = "".join(f"<li>{text}</li>" for text in verdict.advice[:_WORST])
    rest = "".join(f"<li>{text}</li>" for text in verdict.advice[_WORST:])
    more = f"<details><summary>{len(verdict.advice) - _WORST} more</summary><ul>{rest}</ul></details>" if rest else ""
    return (
        f'<section id="verdict"><h2 class="skip">Verdict</h2><div class="verdict {verdict.tone}" role="status">'
        f'<p class="head"><span class="mark" aria-hidden="true">{_MARKS[verdict.tone]}</span> '
        f'<span class="tag">{_WORDS[verdict.tone]}</span> {verdict.head}</p></div>'
        f'<div class="columns"><section class="card"><h2>{verdict.cost_title}</h2>'
        f'<ul class="numbers">{costs}</ul></section>'
        f'<section class="card"><h2>What to do next</h2><ol>{shown}</ol>{more}</section></div>'
        f'<div class="pictures">{"".join(picture for picture in pictures if picture)}</div></section>'
    )


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
