"""Texts of a page of the workbench: verdict, numbers, what a candidate is and would do."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from dash import html

from sdimu_calibration.core.advice import Advice
from sdimu_calibration.core.plain_text import capital
from sdimu_calibration.core.probability import in_percent
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report import data
from sdimu_calibration.report.cost import OVER_MODELS, InUse
from sdimu_calibration.report.markup import signs
from sdimu_calibration.report.odds_section import family_in_words
from sdimu_calibration.report.table import with_sigma
from sdimu_calibration.report.workbench.elements import explained
from sdimu_calibration.report.workbench.fit import Fitted, Missing, Preview
from sdimu_calibration.report.workbench.setting import Setting
from sdimu_calibration.storage.files.advice_words import sentence

_LEAST, _MOST_FAMILIES = 0.05, 6
"""Probability (1) from which a family is listed, and how many are at most: less is one of many."""
_MOST_PARAMETERS = 9
"""Number of parameters of a candidate that are listed: a whole matrix of them."""


def options(entries: Sequence[data.Scored]) -> list[dict[str, str]]:
    """Candidates for the search field, with their evidence."""
    return [
        {
            "label": f"{e.label}   |z| {abs(e.z):.1f}   {with_sigma(e.estimate, e.sigma, e.unit)}"
            if np.isfinite(e.sigma)
            else f"{e.label}   not seen in this test",
            "value": e.label,
        }
        for e in entries
    ]


def verdict(missing: Missing, objections: Sequence[str]) -> tuple[str, str]:
    """Return the verdict in one line, and its class: a tick only where nothing speaks against the model."""
    mark, tone = ("\N{CHECK MARK}", "good") if missing.adequate else ("\N{HEAVY BALLOT X}", "bad")
    if missing.mended or (missing.adequate and objections):
        mark, tone = "\N{WARNING SIGN}", "doubtful"
    cost = (
        "" if missing.worst is None else f" Wrong without it: {missing.worst.text}; \N{PLUS-MINUS SIGN}: {OVER_MODELS}."
    )
    return f"{mark} {signs(missing.sentence + cost)}", f"verdict {tone}"


def odds(missing: Missing) -> list[Any]:
    """List what may be missing, the likeliest first, each with its probability, its members in a tip; what is left."""
    told, left = missing.probabilities, missing.left
    held = (
        ""
        if missing.held_out is None
        else f"Error with a third of the stops left out, as in a report: {missing.held_out:.3f} sigma. "
    )
    rest = html.P(explained(f"{held}Left by stops: chi-square {left.chi2:.0f}, {left.dof} dof."))
    if told is None:
        return [rest]
    rows = [("no effect of the catalogue is missing", told.nothing, "")]
    rows += [
        (
            family_in_words(one),
            one.probability,
            "; ".join(f"{m.label} {in_percent(m.probability)}" for m in one.members),
        )
        for one in told.families
        if one.probability >= _LEAST
    ][:_MOST_FAMILIES]
    lines = [
        html.Tr([html.Td(name, title=members), html.Td(html.Meter(min=0, max=1, value=p)), html.Td(in_percent(p))])
        for name, p, members in rows
    ]
    return [html.Table(html.Tbody(lines), className="odds"), rest]


def numbers(fitted: Fitted, given: Fitted) -> str:
    """Return how well a fit predicts, in one line."""
    fell = "" if fitted is given else f"{given.held_out:.3f} \N{RIGHTWARDS ARROW} "
    held = "" if fitted.at_held is None else f"; of what is left out {fitted.at_held:.3f}"
    errors = f"Error with one stop left out {fell}{fitted.held_out:.3f} sigma{held}."
    return " ".join([errors, *(f"{line}." for line in fitted.calibration.inseparable)])


def in_use(use: InUse | None) -> str:
    """Say the metres without aid of each model, in the words of a report; nothing where there are none."""
    return "" if use is None else f"{capital(use.sentence)}.".replace("->", "\N{RIGHTWARDS ARROW}")


def left_out(setting: Setting) -> str:
    """Say which spans of time are left out."""
    spans = ", ".join(map(span, setting.cut))
    return f"and the times (s) {spans}" if spans else ""


def span(one: tuple[float, float]) -> str:
    """Write a span of time as the option ``--exclude-times`` takes it."""
    return "-".join(f"{t:.3f}".rstrip("0").rstrip(".") for t in one)


def _telling(advice: Advice | None) -> list[Any]:
    """Say what would tell apart what looks the same; nothing where nothing is known to."""
    if advice is None:
        return []
    words = sentence(advice)
    return [html.P(words if advice.verb else f"To tell them: {words}.")]


def candidate(found: Preview, name: str) -> list[Any]:
    """Say what a candidate is, what it would take, what it cannot be told from, and what speaks against it."""
    effect, what = found.effect, found.what
    head = html.P(html.B(capital(effect.title)), id="candidate-name", **{"data-name": name})
    cause = [html.P(effect.description)] if effect.description else []
    alike = (
        [html.P(["Looks the same here: ", ", ".join(what.alike), "."]), *_telling(what.tells)]
        if what.alike
        else [html.P("Nothing else looks the same here.")]
        if not what.objections
        else []
    )
    against = [html.Ul([html.Li(line) for line in what.objections], className="against")] if what.objections else []
    error = " \N{RIGHTWARDS ARROW} ".join(f"{value:.3f}" for value in what.held_out)
    return [
        head,
        html.P(effect.equation, className="equation"),
        *cause,
        *(html.P(line) for line in _sizes(found)),
        html.P(explained(f"Error with one stop left out {error} sigma, by the linear model.")),
        *alike,
        *against,
    ]


def _sizes(found: Preview) -> list[str]:
    what = found.what
    parameters = dict(zip(found.effect.labels, found.effect.parameters, strict=True))
    out: list[str] = []
    for label, value, sigma in zip(what.labels, what.estimate, what.sigma, strict=True):
        if label not in parameters or len(out) == _MOST_PARAMETERS:
            continue
        unit = parameters[label].display_unit
        size = with_sigma(from_si(float(value), unit), from_si(float(sigma), unit), unit)
        out.append(f"{label}: {size}, {value / sigma if sigma else 0.0:+.1f} sigma")
    return out
