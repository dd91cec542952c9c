"""report.html: one file that needs no network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.summary import DiagnosisSummary
from sdimu_calibration.core.results import Calibration, without_advice
from sdimu_calibration.report import data, handheld_sections, sections, table
from sdimu_calibration.report.design.sheet import document
from sdimu_calibration.report.drawing import html
from sdimu_calibration.report.export import as_csv, as_yaml
from sdimu_calibration.report.figures import sigma_history
from sdimu_calibration.report.markup import Draw, prose, quiet, section
from sdimu_calibration.report.report_extras import ReportExtras
from sdimu_calibration.report.rests_section import rests_section
from sdimu_calibration.report.set_sections import set_sections
from sdimu_calibration.report.use_section import in_use
from sdimu_calibration.storage.whole_file import write_whole

_TEXT_COLUMNS = frozenset({"coefficient", "unit"})


def write_report(
    path: Path,
    calibration: Calibration,
    *,
    title: str = "Calibration",
    truth: Mapping[str, float] | None = None,
    reference: Mapping[str, float] | None = None,
    summary: DiagnosisSummary | None = None,
    more: ReportExtras | None = None,
    lead: str = "",
) -> None:
    """Write report.html.

    Parameters
    ----------
    path : Path
        File to make or replace; its folder is made too.
    calibration : Calibration
        Whose coefficients are shown; with a diagnosis usually `summary.diagnosis.after`.
    title : str
        Heading of the page.
    truth : mapping of str to float, optional
        True values (SI) by coefficient name, in the body frame of the calibration.
    reference : mapping of str to float, optional
        Published sigmas (SI) by effect name.
    summary : DiagnosisSummary, optional
        Adds the verdict, what is missing, where it fails, and how the error falls.
    more : ReportExtras, optional
        What to show besides the diagnosis: table angles, drift in use.
    lead : str
        Sentence that stands first on the page of a set.
    """
    write_whole(path, page(calibration, title, truth, reference, summary, more, lead))


class _Drawing:
    """Turns figures into parts of one page; the first brings the library along."""

    def __init__(self) -> None:
        self._count = 0

    def __call__(self, figure: Any) -> str:
        self._count += 1
        return html(figure, self._count)


def page(
    calibration: Calibration,
    title: str,
    truth: Mapping[str, float] | None = None,
    reference: Mapping[str, float] | None = None,
    summary: DiagnosisSummary | None = None,
    more: ReportExtras | None = None,
    lead: str = "",
) -> str:
    """Make the page as HTML text; parameters as in `write_report`."""
    draw = _Drawing()
    more = more or ReportExtras()
    handheld = summary is not None and summary.diagnosis.fit.learns_scatter
    shown = None if summary is None or handheld else _Shown.of(summary.diagnosis)
    parts = [] if summary is None else _evidence(summary, shown, more, draw)
    parts += [] if calibration.of_set is None else set_sections(calibration, calibration.of_set, draw)
    parts.append(_coefficients(calibration, truth, reference))
    parts += [rests_section(calibration.rests)] if calibration.rests else []
    parts += [] if summary is None or shown is None else _residuals(summary.diagnosis, shown, more, draw)
    if len(calibration.history.t):
        remark = quiet("Closed-loop pass. Grey: the table turns, no measurements.")
        parts.append(section("Sigma of every coefficient against time", remark, draw(sigma_history(calibration))))
        parts.append(sections.separation(calibration, draw))
    head = [
        sections.verdict(summary) if summary else "",
        f"<p><b>{prose(lead)}</b></p>" if lead else "",
        # Of a handheld run the ladder says it, in sigmas that models can be compared by.
        "" if handheld else f"<p>{_fit(calibration, summary is not None or bool(lead))}</p>",
        _notes(calibration.notes if summary is None else without_advice(calibration.notes)),
    ]
    return document(title, "\n".join(part for part in (*head, *parts) if part), under=_summary(calibration))


@dataclass(frozen=True)
class _Shown:
    """Numbers of a diagnosis by navigation that several parts of the page show."""

    candidates: list[data.Scored]
    residuals: data.Residuals

    @classmethod
    def of(cls, diagnosis: Diagnosis) -> _Shown:
        return cls(data.scored(diagnosis), data.residuals(diagnosis))


def _evidence(summary: DiagnosisSummary, shown: _Shown | None, more: ReportExtras, draw: Draw) -> list[str]:
    """Tell what is missing and where it shows."""
    diagnosis = summary.diagnosis
    if shown is None:
        return handheld_sections.evidence(summary, draw)
    return [
        sections.ladder(diagnosis, draw),
        sections.refits(diagnosis.rungs),
        sections.missing(diagnosis, shown.candidates, draw),
        sections.where(diagnosis, shown.residuals, draw),
        in_use(more, draw),
    ]


def _residuals(diagnosis: Diagnosis, shown: _Shown, more: ReportExtras, draw: Draw) -> list[str]:
    """Show the data themselves, and tell what they could have shown."""
    return [
        sections.residuals(diagnosis, shown.residuals, more, draw),
        sections.smallest(shown.candidates),
    ]


def _coefficients(
    calibration: Calibration, truth: Mapping[str, float] | None, reference: Mapping[str, float] | None
) -> str:
    entries = table.rows(calibration, truth, reference)
    copies = {"YAML": as_yaml(entries, calibration.body_frame), "CSV": as_csv(entries)}
    buttons = "".join(f'<button data-copy="copy-{kind}">Copy as {kind}</button>' for kind in copies)
    texts = "".join(
        f'<textarea id="copy-{kind}" hidden readonly>{escape(text)}</textarea>' for kind, text in copies.items()
    )
    return section(
        "Coefficients",
        f"<p>{buttons}{texts}</p>",
        f'<div class="wide">{_table(entries)}</div>',
        quiet(
            f"One sigma; body frame: {calibration.body_frame.replace('_', ' ')}. "
            "Fixed: zero by the choice of that frame."
        ),
    )


def _summary(calibration: Calibration) -> str:
    counts = calibration.data
    words = [
        f"{counts['duration_s'] / 60.0:.1f} min" if "duration_s" in counts else "",
        *(f"{counts[key]:.0f} {key}" for key in ("stops", "samples", "lost", "rejected") if key in counts),
        *calibration.origin.words,
        f"{len(calibration.names)} coefficients of {len(calibration.model)} effects",
    ]
    return escape(" · ".join(word for word in words if word))


def _fit(calibration: Calibration, diagnosed: bool) -> str:
    """Say what the fit figures mean; no verdict without a diagnosis."""
    nis, dof = calibration.fit.get("nis_mean"), calibration.fit.get("nis_dof")
    held_out = calibration.fit.get("held_out_rms")
    sentences = ["With the coefficients on this page:"] if diagnosed else []
    if nis is not None and dof:
        sentences.append(f"Squared innovations are {nis:.3f} times what the noise explains ({dof:.0f} in number).")
    if held_out is not None:
        left_out = "Stops" if calibration.of_set is None else "Recordings"
        sentences.append(
            f"{left_out} that the fit has not seen are predicted to {held_out:.2f} sigma (RMS); 1 is right."
        )
    if not sentences:
        return "Fit: not computed."
    if not diagnosed:
        sentences.append("Whether something is missing in the model, and what: sdimu diagnose.")
    return escape(" ".join(sentences))


def _notes(notes: Sequence[str]) -> str:
    return "<ul>" + "".join(f"<li>{prose(note)}</li>" for note in notes) + "</ul>" if notes else ""


def _table(entries: list[table.Row]) -> str:
    columns = table.headings(entries)
    kinds = [' class="text"' if column in _TEXT_COLUMNS else "" for column in columns]
    head = "".join(f"<th{kind}>{escape(column)}</th>" for column, kind in zip(columns, kinds, strict=True))
    lines = []
    before = None
    for row in entries:
        first = ' class="first"' if row.effect != before else ""
        before = row.effect
        values = zip(table.cells(row, columns), kinds, strict=True)
        lines.append(f"<tr{first}>" + "".join(f"<td{kind}>{escape(text)}</td>" for text, kind in values) + "</tr>")
    return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(lines)}</tbody></table>"
