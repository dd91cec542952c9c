"""Texts of the live page: the verdict, candidates and probabilities, what was chosen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from dash import html

from sdimu_calibration.core.probability import in_percent
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.report.groups import title
from sdimu_calibration.report.live_page.record import End, Head, LiveView, catalogue
from sdimu_calibration.report.live_text import SeenChoice, SeenDiagnosis, SeenFamily
from sdimu_calibration.report.markup import signs
from sdimu_calibration.report.progress_text import short

_LEAST, _MOST_FAMILIES = 0.05, 8
"""Probability (1) from which a family is listed, and how many are at most: less is one of many."""
_MOST_CHOICES = 60
"""Number of earlier choices that are listed, the newest first: a page of an hour stays quick."""
_LATE_S = 30.0
"""Time of the test (s) from which a page has joined it late."""
_TONES = {
    Verdict.CONSISTENT: ("good", "\N{CHECK MARK}"),
    Verdict.WAITING: ("neutral", "\N{HORIZONTAL ELLIPSIS}"),
    Verdict.UNEXPLAINED: ("bad", "\N{HEAVY BALLOT X}"),
    Verdict.DATA_FAULT: ("bad", "\N{HEAVY BALLOT X}"),
}
_DOUBTFUL = ("doubtful", "\N{WARNING SIGN}")


def place(head: Head) -> Any:
    """Say where the test is, with a bar where it is known how long it lasts; a test that has ended has none.

    One that chooses its turns may end at a tenth of its time, and a bar that stands there looks like one that waits.
    """
    bar = [] if head.end or head.share is None else [_bar(head.share)]
    return [html.B(head.place), *bar, html.Span(head.time)]


def _bar(share: float) -> Any:
    return html.Progress(value=f"{share:.3f}", max="1", **{"aria-label": "share of the test that is done"})


def ended(end: End) -> list[Any]:
    """Say how the test ended, and how its report is shown."""
    told = [html.B(end.words)]
    return [*told, " The report: ", html.Code(end.command, className="command")] if end.command else told


def end_class(end: End | None) -> str:
    """Return the class of what is said of the end; without one it is not shown."""
    return "no-end" if end is None else f"ended {'good' if end.good else 'bad'}"


def verdict(view: LiveView) -> tuple[str, str]:
    """Return the last diagnosis in one line, and its class."""
    seen = view.diagnosis
    if seen.stop < 0:
        return view.not_yet, "verdict neutral"
    tone, mark = _TONES.get(Verdict(seen.verdict), _DOUBTFUL)
    return f"{mark} Up to stop {seen.stop}: {signs(seen.sentence)}", f"verdict {tone}"


def candidates(view: LiveView) -> list[Any]:
    """List what would explain the misfit: before the end by its score, then by its probability.

    Before the end a candidate whose score noise reaches is not listed: it explains nothing.
    """
    seen = view.diagnosis
    if seen.families or not math.isnan(seen.nothing):
        return _odds(seen)
    if not seen.ranking:
        return [html.P(view.not_yet, className="quiet")]
    if not seen.standing:
        words = f"Nothing stands out: {seen.reaches}, and the score of no candidate is larger."
        return [html.P(words, className="quiet")]
    rows = [
        html.Tr(html.Td([html.Button(label, className="row"), html.Span(signs(score))]), **{"data-candidate": label})
        for label, score in seen.ranking[: seen.standing]
    ]
    return [
        html.P(f"Score and size of each alone; {seen.reaches}. Click one to choose it.", className="quiet"),
        html.Div(html.Table(html.Tbody(rows)), className="scroll"),
    ]


def _odds(seen: SeenDiagnosis) -> list[Any]:
    listed = [one for one in seen.families if one.probability >= _LEAST][:_MOST_FAMILIES]
    nothing = SeenFamily("no effect of the catalogue is missing", seen.nothing)
    return [
        html.P("Probability of each cause, over all models that the data leave probable.", className="quiet"),
        *(_family(one) for one in (nothing, *listed)),
    ]


def _family(one: SeenFamily) -> Any:
    """Return a family with its members folded into it."""
    line = [
        html.Meter(min=0, max=1, value=f"{one.probability:.3f}"),
        html.B(in_percent(one.probability)),
        html.Span(one.name),
    ]
    if len(one.members) < 2:
        name = [html.Code(label) for label, _ in one.members]
        return html.Div([*line, *name], className="family")
    members = [html.Li([html.Code(label), f" {in_percent(p)}"]) for label, p in one.members]
    return html.Details([html.Summary(line, className="family"), html.Ul(members)])


def choices(made: Sequence[SeenChoice]) -> list[Any]:
    """Tell the turn that was chosen last with its reason, those before it folded."""
    if not made:
        return [html.P("This test follows a plan.", className="quiet")]
    *before, last = made
    told = [html.P([html.B(f"{last.minutes:.1f} min "), signs(last.text)]), html.P(_worst(last), className="quiet")]
    older = [html.Li(f"{one.minutes:.1f} min {signs(one.text)}") for one in reversed(before)][:_MOST_CHOICES]
    return [*told, *([html.Details([html.Summary("Earlier turns"), html.Ul(older)])] if older else [])]


def _worst(choice: SeenChoice) -> str:
    return f"Largest sigma over its limit: {choice.worst:.2f}; 1 is reached." if math.isfinite(choice.worst) else ""


def options(seen: SeenDiagnosis) -> list[dict[str, str]]:
    """Effects that may be added, the candidates first, with their scores."""
    ranked = dict(seen.ranking)
    first = [{"label": f"{label}   {signs(score)}", "value": label} for label, score in ranked.items()]
    return [*first, *({"label": name, "value": name} for name in catalogue() if name not in ranked)]


def joined(view: LiveView) -> str:
    """Say from when the sigmas are drawn, where that is not the begin."""
    if view.joined_s < _LATE_S:
        return ""
    return f"Watched from {view.joined_s / 60.0:.1f} min on; shares are of the sigmas at the start of the test."


def largest(view: LiveView) -> str:
    """Name the effect that is known least, for those who do not see the figure."""
    if not view.fallen:
        return ""
    worst = view.fallen[0]
    return f"Known least: {title(worst.effect)}, {short(100.0 * worst.share)} % of its sigma at the start is left."
