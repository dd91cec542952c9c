"""report.html: one file that needs no network. Sections stand in the order of use."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sdimu_calibration.core.diagnosis.grades import size_of
from sdimu_calibration.core.diagnosis.summary import DiagnosisSummary
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.note import without_advice
from sdimu_calibration.core.results import Calibration, Rest
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report import data, experiment, first_screen, handheld_sections, sections
from sdimu_calibration.report.advice import Spell
from sdimu_calibration.report.beside_title import of_calibration
from sdimu_calibration.report.coefficients import coefficients_section
from sdimu_calibration.report.design.sheet import document
from sdimu_calibration.report.drawing import html
from sdimu_calibration.report.markup import Card, Draw, anchor, grid, prose, quiet, section, signs
from sdimu_calibration.report.odds_section import odds_of_set, odds_section
from sdimu_calibration.report.report_extras import ReportExtras, of_navigations
from sdimu_calibration.report.set_sections import recurrence_section, set_sections, where_it_fails
from sdimu_calibration.report.statistics_section import noise_section
from sdimu_calibration.report.table import as_far
from sdimu_calibration.report.traceability import traceability
from sdimu_calibration.report.unknown_section import unknown_of, unknown_section
from sdimu_calibration.report.use_section import in_use
from sdimu_calibration.storage.files.whole_file import write_whole
from sdimu_calibration.storage.trace import Trace

if TYPE_CHECKING:  # a result of one recording has none: fifty modules less to load
    from sdimu_calibration.core.joint.set_diagnosis import SetDiagnosis


@dataclass(frozen=True)
class Contents:
    """What a page shows besides the coefficients of a calibration; entries as the arguments of `write_report`."""

    title: str = "Calibration"
    truth: Mapping[str, float] | None = None
    reference: Mapping[str, float] | None = None
    summary: DiagnosisSummary | None = None
    more: ReportExtras | None = None
    fit: Fit | None = None
    of_set: SetDiagnosis | None = None
    trace: Trace | None = None
    spell: Spell | None = None


def write_report(
    path: Path,
    calibration: Calibration,
    *,
    title: str = "Calibration",
    truth: Mapping[str, float] | None = None,
    reference: Mapping[str, float] | None = None,
    summary: DiagnosisSummary | None = None,
    more: ReportExtras | None = None,
    fit: Fit | None = None,
    of_set: SetDiagnosis | None = None,
    trace: Trace | None = None,
    spell: Spell | None = None,
) -> None:
    """Write report.html.

    Parameters
    ----------
    calibration : Calibration
        Whose coefficients are shown; with a diagnosis usually `summary.diagnosis.after`.
    truth : mapping of str to float, optional
        True values (SI) by coefficient name, in the body frame of the calibration.
    reference : mapping of str to float, optional
        Published sigmas (SI) by effect name.
    summary : DiagnosisSummary, optional
        Adds the verdict, what is missing, where it fails, and how the error falls.
    more : ReportExtras, optional
        What to show besides the diagnosis: table angles, drift in use.
    fit : Fit, optional
        Of the calibration: adds data, innovations and priors; that of the diagnosis where there is one.
    of_set : SetDiagnosis, optional
        What was found in a set of recordings.
    trace : Trace, optional
        Command, program, files and their hashes.
    spell : callable, optional
        Writes the whole command that an advice means.
    """
    contents = Contents(title, truth, reference, summary, more, fit, of_set, trace, spell)
    write_whole(path, page(calibration, contents))


class _Drawing:
    """Turns figures into parts of one page."""

    def __init__(self) -> None:
        self._count = 0

    def __call__(self, figure: Any) -> str:
        self._count += 1
        return html(figure, self._count)


def page(calibration: Calibration, contents: Contents) -> str:
    """Make the page as HTML text."""
    summary, fit, of_set, spell = contents.summary, contents.fit, contents.of_set, contents.spell
    draw, more = _Drawing(), contents.more or ReportExtras()
    if summary is not None:
        fit = summary.diagnosis.extended
    parts = [
        _first(calibration, contents, fit, draw),
        coefficients_section(calibration, fit, contents.truth, contents.reference, _lacks(calibration, summary), draw),
        odds_of_set(of_set) if of_set is not None else "",
        recurrence_section(of_set.recurrence) if of_set is not None and of_set.recurrence else "",
        unknown_section(of_set.unknown, draw) if of_set is not None else "",
        in_use(of_navigations(of_set.ladder), draw) if of_set is not None else "",
        *([] if calibration.of_set is None else set_sections(calibration, calibration.of_set, draw)),
        *([] if summary is None else _evidence(summary, more, _means(calibration, summary), spell, draw)),
        rests_section(calibration.rests) if calibration.rests else "",
        noise_section(fit, draw) if isinstance(fit, NavigationFit) else "",
        experiment.data_section(fit, draw) if fit is not None else "",
        _notes(without_advice(calibration.notes) if summary or of_set else calibration.notes),
        traceability(calibration, contents.trace),
    ]
    body = "\n".join(part for part in parts if part)
    headings = ["Verdict", *(part.heading for part in parts if isinstance(part, Card))]
    return document(
        contents.title,
        body,
        under=escape(of_calibration(calibration)),
        contents=[(anchor(heading), heading.partition(":")[0]) for heading in headings],
        script=experiment.ATTITUDE_SCRIPT if fit is not None else "",
    )


def _first(calibration: Calibration, contents: Contents, fit: Fit | None, draw: Draw) -> str:
    """Verdict, costs, advice, ladder and heat map."""
    summary, of_set, spell = contents.summary, contents.of_set, contents.spell
    if summary is not None:
        verdict = first_screen.of_diagnosis(summary, spell, contents.more)
        handheld = summary.diagnosis.fit.learns_scatter
        maps = handheld_sections.heat_maps(summary, draw) if handheld else sections.heat_maps(summary.diagnosis, draw)
        return first_screen.render(verdict, maps)
    if of_set is not None:
        return first_screen.render(first_screen.of_set(of_set, spell), where_it_fails(of_set, draw))
    caption = sections.caption_of_map(bool(calibration.noise), bool(calibration.misfits))
    maps = sections.heat_map_card([fit.consistency()], draw, caption) if isinstance(fit, NavigationFit) else ""
    return first_screen.render(first_screen.of_fit(calibration, spell), maps)


def _lacks(calibration: Calibration, summary: DiagnosisSummary | None) -> tuple[str, ...]:
    """Name the effects that were found and that the coefficients of the page do not have."""
    return () if summary is None else tuple(n for n in summary.diagnosis.after.names if n not in calibration.names)


def _means(calibration: Calibration, summary: DiagnosisSummary) -> bool:
    """Whether the coefficients of the page are those of the diagnosis, and not of a model as it was given."""
    after = summary.diagnosis.after
    return calibration.names == after.names and np.array_equal(calibration.values, after.values)


def _evidence(summary: DiagnosisSummary, more: ReportExtras, means: bool, spell: Spell | None, draw: Draw) -> list[str]:
    """Tell what is missing, what it would be confused with, what it does in use, and where it shows.

    `means`: as for `odds_section`.
    """
    diagnosis = summary.diagnosis
    found = {one.candidate.label: signs(size_of(one)) for one in summary.found}
    if diagnosis.fit.learns_scatter:
        odds = odds_section(diagnosis.probabilities, "in this run", found=found, means=means)
        return [odds, *handheld_sections.evidence(summary, draw), sections.confused(summary, spell)]
    candidates, residuals = data.scored(diagnosis), data.residuals(diagnosis)
    return [
        odds_section(diagnosis.probabilities, found=found, means=means),
        unknown_section(unknown_of(diagnosis), draw),
        sections.effects(summary, candidates, draw),
        sections.confused(summary, spell),
        sections.smallest(summary.reached, summary.assumed, summary.untestable),
        in_use(more, draw),
        sections.residuals(diagnosis, residuals, more, draw),
    ]


def _notes(notes: Sequence[str]) -> str:
    items = "".join(f"<li>{prose(note)}</li>" for note in notes)
    return section("Notes", f"<ul>{items}</ul>") if notes else ""


_COLUMNS = (
    "rest",
    "from (s)",
    "to (s)",
    "force x y z (ug)",
    "in sigmas",
    "rate x y z (deg/h)",
    "in sigmas",
    "turn to it N E D (arcmin)",
    "in sigmas",
)


def rests_section(rests: Sequence[Rest]) -> str:
    """List the rests with what the fit leaves over at each."""
    rows = [_row(number, rest) for number, rest in enumerate(rests)]
    return section(
        "Rests and their residuals",
        grid(_COLUMNS, rows, set()),
        quiet(
            "Measured less predicted: the mean force and rate of each rest, and the turn from the rest before it (the "
            "heading of north is arbitrary). In sigmas: root mean square of the three axes over white noise and the "
            "scatter that was learned beyond it. A turn with a gap in it says nothing."
        ),
    )


def _row(number: int, rest: Rest) -> list[str]:
    out = [str(number), f"{rest.start_s:.1f}", f"{rest.end_s:.1f}"]
    for residual, sigma, unit in (
        (rest.force, rest.force_sigma, "ug"),
        (rest.rate, rest.rate_sigma, "deg/h"),
        (rest.turn, rest.turn_sigma, "arcmin"),
    ):
        seen = bool(np.isfinite(residual).all())
        shown = as_far([from_si(value, unit) for value in residual], from_si(sigma, unit)) if seen else []
        out.append("\N{EM SPACE}".join(shown))
        out.append(f"{np.sqrt(np.mean(np.square(residual))) / sigma:.2f}" if seen and sigma > 0.0 else "")
    return out
