"""A diagnosis in the terminal: the verdict first, then where, what, how far the error fell, what was out of sight."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING

from sdimu_calibration.cli.console import say as line
from sdimu_calibration.cli.next_commands import print_advice
from sdimu_calibration.cli.wide_table import print_table
from sdimu_calibration.core.diagnosis.found import TOLD_AS
from sdimu_calibration.core.diagnosis.grades import NAMED, percents_of
from sdimu_calibration.core.diagnosis.ladder import figures_in_words
from sdimu_calibration.core.diagnosis.verdict import POSSIBLE, beyond, error_falls
from sdimu_calibration.core.error_figures import held_out, noise_learned
from sdimu_calibration.core.evidence.testable import UNSEEN
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.note import without_advice
from sdimu_calibration.core.plain_text import capital
from sdimu_calibration.core.probability import in_percent
from sdimu_calibration.core.units import UnitError, from_si
from sdimu_calibration.report.cost import OVER_MODELS, TOO_LARGE, in_use, wrong_without

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import Console

    from sdimu_calibration.cli.next_commands import Asked
    from sdimu_calibration.core.diagnosis.assumed import Assumed
    from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
    from sdimu_calibration.core.diagnosis.found import DetectableSize, Found
    from sdimu_calibration.core.diagnosis.ladder import Rung
    from sdimu_calibration.core.diagnosis.step import Step
    from sdimu_calibration.core.diagnosis.summary import DiagnosisSummary
    from sdimu_calibration.core.posterior.told import Probabilities
    from sdimu_calibration.report.report_extras import ReportExtras

_TOP = 5
_WORST = 4
"""Number of coefficients that are named as wrong: the page has the rest."""
_WHOLE = 100.0
"""Number from which a size has no decimals: two digits of it would be written with an exponent."""
_EACH = 4
"""Number of families of which the smallest size is told, of gyros and of accelerometers each."""
_ASSUMED = 4
"""Number of effects taken for granted that are named: the page has them for every coefficient."""


def print_summary(console: Console, summary: DiagnosisSummary, asked: Asked, more: ReportExtras | None = None) -> None:
    """Print everything that a diagnosis has to say; its advice as commands for what was asked."""
    d = summary.diagnosis
    said = summary.diagnosis.sentence
    line(console, said)
    for text in cost_lines(summary, more):
        line(console, text)
    for finding in d.findings:
        if capital(finding.text) not in said:
            line(console, f"data: {finding.text}")
    for text in d.noise:
        if text not in said:
            line(console, f"noise: {text}")
    _where(console, summary)
    _candidates(console, summary)
    _possible(console, summary)
    if summary.found:
        line(console, held_out_line(d))
    for text in step_lines(d.found.steps):
        line(console, text)
    print_ladder(console, d.rungs, d.found.noise)
    print_out_of_sight(console, summary)
    print_advice(console, summary.advice, asked)


def cost_lines(summary: DiagnosisSummary, more: ReportExtras | None) -> list[str]:
    """Say what a missing effect costs: metres without aid, then the coefficients that are wrong without it."""
    use = in_use(more)
    lines = [] if use is None else [use.sentence]
    off = wrong_without(summary, more)
    if off:
        rest = f" and {len(off) - _WORST} more" if len(off) > _WORST else ""
        worst = ", ".join(one.text for one in off[:_WORST])
        lines.append(f"wrong without it: {worst}{rest}; {TOO_LARGE}; +-: {OVER_MODELS}")
    return lines


def held_out_line(d: Diagnosis) -> str:
    """Say how far the error falls where the fit has not seen the data."""
    if d.fit.learns_scatter:
        return error_falls(d)
    white = " in white noise" if noise_learned(d.after) else ""
    falls = f"{held_out(d.before):.3f} -> {held_out(d.after):.3f}"
    return f"held-out error{white}, at stops that the fit has not seen: {falls}"


def notes_of_diagnosis(d: Diagnosis) -> tuple[str, ...]:
    """Return the notes of the fit that still hold: all of a run by hand, else its warnings and that headings are lost.

    What stands among the findings is not said twice.
    """
    from sdimu_calibration.core.estimation.azimuth_words import NO_AZIMUTH

    if d.fit.learns_scatter:
        return without_advice(d.after.notes)
    said = {finding.text for finding in d.findings}
    lost = [note for note in d.after.notes if note == NO_AZIMUTH]
    return tuple(note for note in without_advice((*lost, *d.after.warnings)) if note not in said)


def amount(value: float, unit: str, digits: int = 3) -> str:
    """Write an SI number in `unit`; the unit itself stays out."""
    try:
        return f"{from_si(value, unit):.{digits}g}"
    except UnitError:
        return f"{value:.{digits}g}"


def _where(console: Console, summary: DiagnosisSummary) -> None:
    top = summary.diagnosis.consistency.where[:_TOP]
    if summary.diagnosis.adequate or not top:
        return
    places = ", ".join(f"{w.channel} at stop {w.stop} ({w.normalised_mean:+.1f} sigma)" for w in top)
    white = " in white noise" if summary.diagnosis.found.noise else ""
    line(console, f"worst{white}: {places}")


def _candidates(console: Console, summary: DiagnosisSummary) -> None:
    shown = summary.candidates or summary.found
    if not shown:
        return
    lines = [row for one in shown for row in candidate_rows(one, summary.diagnosis.probabilities)]
    title = "found" if summary.candidates else "found, and not enough to explain what is left"
    print_table(console, CANDIDATE_HEADINGS, lines, title)
    for f in shown:
        alike = f"looks here like {', '.join(f.alike[:4])}" if f.alike and len(f.may_be) < 2 else ""
        pairs = [f"{one} with {other} ({in_percent(p)})" for one, other, p in f.together[:_TOP] if p >= NAMED]
        same = f"the same by two effects together: {', '.join(pairs)}" if pairs else ""
        fall = _fall(f) if len(shown) > 1 else ""
        words = "; ".join(part for part in (fall, alike, same) if part)
        if words:
            line(console, f"{f.candidate.label}: {words}")


CANDIDATE_HEADINGS = ("effect", "estimate", "+-", "unit", "probability", "z")


def candidate_rows(f: Found, told: Probabilities | None) -> list[list[str]]:
    """Rows of an effect that was found, and of what it may be instead: each with the probability that it is this one.

    `told`: where the sizes stand of what it may be instead.
    """
    own = f.candidate.coefficient
    percent = percents_of(f.may_be)
    alone = in_percent(f.probability) if isfinite(f.probability) else ""
    unit = f.candidate.parameter.display_unit
    size = [amount(f.value, unit, 4), amount(f.sigma, unit, 2), unit]
    rows = [[f.candidate.label, *size, percent.get(own, alone), f"{f.z:+.1f}"]]
    others = [share for share in f.may_be[:_TOP] if share.name != own and share.probability >= NAMED]
    more = [[f"  or {one.name}", *_size_of(one.name, told), percent[one.name], ""] for one in others]
    return rows + more


def _size_of(name: str, told: Probabilities | None) -> list[str]:
    """Size, sigma and unit of the likeliest member of that name; empty texts where nothing is told of it."""
    members = [m for family in told.families for m in family.members] if told is not None else []
    of_name = [m for m in members if m.label.partition("(")[0] == name and isfinite(m.value)]
    if not of_name:
        return ["", "", ""]
    m = max(of_name, key=lambda one: one.probability)
    return [amount(m.value, m.display_unit, 4), amount(m.sigma, m.display_unit, 2), m.display_unit]


def _possible(console: Console, summary: DiagnosisSummary) -> None:
    """Print what is open: families of effects and noise that are neither told nor ruled out."""
    told = summary.diagnosis.probabilities
    if told is None:
        return
    named = {share.name for f in summary.found for share in f.may_be} | {f.candidate.label for f in summary.found}
    possible = [
        f"{one.members[0].label} {in_percent(one.probability)}"
        for one in told.families
        if one.probability >= POSSIBLE
        and one.members
        and not {one.members[0].label, one.members[0].label.partition("(")[0]} & named
    ]
    if possible:
        line(console, f"possible, and not told: {', '.join(possible[:_TOP])}")
    known = {(term.triad, term.kind) for term in summary.diagnosis.found.noise}
    noise = [
        f"{NoiseTerm(n.triad, n.kind, axes=n.axes).words} {in_percent(n.probability)}"
        for n in told.noise
        if n.probability >= POSSIBLE and (n.triad, n.kind) not in known
    ]
    if noise:
        line(console, f"noise with a memory that is possible: {', '.join(noise[:_TOP])}")


def _fall(f: Found) -> str:
    """Say the held-out error without and with an effect; nothing where no such model was fitted."""
    known = f.held_out_before == f.held_out_before and f.held_out_after == f.held_out_after
    return f"held-out error {f.held_out_before:.3f} -> {f.held_out_after:.3f}" if known else ""


def step_lines(steps: Sequence[Step]) -> list[str]:
    """Say of each effect what it adds to those before it."""
    return [
        f"step {number}: {s.label} (z {s.z:+.1f}, threshold {s.threshold:.1f}, log Bayes factor "
        f"{s.log_bayes_factor:.0f}; log score of stops left out {s.held_out_gain:+.0f} +- {s.held_out_error:.0f})"
        for number, s in enumerate(steps, start=1)
    ]


def print_out_of_sight(console: Console, summary: DiagnosisSummary) -> None:
    """Print how many effects could not have been seen, and why."""
    hidden = [r for r in summary.reached if not r.testable]
    if hidden:
        count = f"{len(hidden)} of {len(summary.reached)} candidates (each axis and time of an effect counts)"
        line(console, f"{count} {UNSEEN} with this plan:")
    for group in summary.untestable:
        names = ", ".join(group.labels[:3]) + (" ..." if len(group.labels) > 3 else "")
        line(console, f"  {group.reason}: {len(group.labels)} ({names})")
    if summary.assumed:
        line(
            console,
            "shown weakly or not at all by this plan, and taken as absent by the coefficients: "
            f"{taken_for_granted(summary.assumed)}",
        )
    if any(r.testable for r in summary.reached):
        line(console, f"size that is told in 80 % of tests ({TOLD_AS}): {smallest(summary.reached)}")


def taken_for_granted(assumed: Sequence[Assumed]) -> str:
    """Say what would move coefficients if it were there after all: of each effect the largest move."""
    first: dict[str, Assumed] = {}
    for one in assumed:
        first.setdefault(one.family, one)
    told = [
        f"if {one.label} were {amount(one.size, one.display_unit)} {one.display_unit}, "
        f"{one.coefficient} would be wrong by {one.sigmas:.0f} sigma"
        for one in first.values()
    ]
    return "; ".join(told[:_ASSUMED])


def smallest(reached: tuple[DetectableSize, ...]) -> str:
    """Say the smallest sizes of a few typical effects."""
    return "; ".join(_size(r) for r in _typical(reached))


def _typical(reached: tuple[DetectableSize, ...]) -> list[DetectableSize]:
    """One candidate of each of the first families of gyros and of accelerometers: enough to see the scale of things."""
    chosen: dict[str, DetectableSize] = {}
    for r in reached:
        if r.testable:
            chosen.setdefault(r.family, r)
    triads = [[r for r in chosen.values() if r.family.startswith(triad)][:_EACH] for triad in ("gyro", "accel")]
    return [r for triad in triads for r in triad]


def _size(r: DetectableSize) -> str:
    size = from_si(r.smallest, r.display_unit)
    return f"{r.label} {size:.{0 if size >= _WHOLE else 2}{'f' if size >= _WHOLE else 'g'}} {r.display_unit}"


def print_ladder(console: Console, rungs: tuple[Rung, ...], noise: Sequence[NoiseTerm]) -> None:
    """Print the ladder of refits; nothing when there is none. `noise`: with a memory, that the diagnosis found."""
    if not rungs:
        return
    handheld = rungs[0].scatter is not None
    last = ("beyond white noise",) if handheld else ("jump after turns", "moved by more than 2 sigma")
    headings = ("model", "log-likelihood", "log Bayes factor", "nis", "held-out", *last)
    print_table(console, headings, [_rung(r) for r in rungs], "ladder of refits")
    line(console, figures_in_words(rungs, noise))
    if not handheld:
        line(console, "moved: value less that of the model above, in sigmas of the latter")


def _rung(r: Rung) -> list[str]:
    name = f"+ {r.added}" if r.added else "as given"
    moved = ", ".join(f"{n} {s:+.1f}" for n, s in r.moved[:4])
    if not r.accepted:
        name, moved = f"{name} (refused)", r.reason
    row = [
        name,
        f"{r.log_likelihood:.1f}",
        f"{r.log_bayes_factor:+.1f}" if r.added else "",
        f"{r.nis_mean:.3f}",
        f"{r.held_out_rms:.3f}",
    ]
    if r.scatter is not None:
        return [*row, beyond(r.scatter)]
    return [*row, f"{r.jump:.2f} sigma, {1e3 * r.jump_velocity:.2f} mm/s", moved]
