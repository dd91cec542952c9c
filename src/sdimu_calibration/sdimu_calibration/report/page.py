"""report.html: one file that needs no network."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from pathlib import Path

from sdimu_calibration.core.results import Calibration
from sdimu_calibration.report import table
from sdimu_calibration.report.figures import sigma_history

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 1100px; margin: 2em auto; padding: 0 1.5em; }
h1 { font-size: 1.5em; margin-bottom: 0; } h2 { font-size: 1.15em; margin-top: 2em; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .15em .8em; text-align: right; border-bottom: 1px solid #e4e4e4; }
th { border-bottom: 2px solid #222; } th.text, td.text { text-align: left; }
tr.first td { border-top: 1px solid #888; }
.quiet { color: #555; }
"""

_TEXT_COLUMNS = frozenset({"coefficient", "unit"})


def write_report(
    path: Path,
    calibration: Calibration,
    *,
    title: str = "Calibration",
    truth: Mapping[str, float] | None = None,
    reference: Mapping[str, float] | None = None,
) -> None:
    """Write report.html.

    Parameters
    ----------
    path : Path
        File to make or replace; its folder is made too.
    calibration : Calibration
    title : str
        Heading of the page.
    truth : mapping of str to float, optional
        True values (SI) by coefficient name, in the body frame of the calibration.
    reference : mapping of str to float, optional
        Published sigmas (SI) by effect name.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.part")
    temporary.write_text(page(calibration, title, truth, reference), encoding="utf-8")
    temporary.replace(path)


def page(
    calibration: Calibration,
    title: str,
    truth: Mapping[str, float] | None = None,
    reference: Mapping[str, float] | None = None,
) -> str:
    """Make the page as HTML text; parameters as in `write_report`."""
    parts = [
        f"<h1>{escape(title)}</h1>",
        f'<p class="quiet">{_summary(calibration)}</p>',
        "<h2>Does the model fit?</h2>",
        f"<p>{_fit(calibration)}</p>",
        _notes(calibration),
        "<h2>Coefficients</h2>",
        _table(table.rows(calibration, truth, reference)),
        f'<p class="quiet">One sigma; body frame: {escape(calibration.body_frame.replace("_", " "))}. '
        "Fixed: zero by the choice of that frame.</p>",
    ]
    if len(calibration.history.t):
        figure = sigma_history(calibration).to_html(full_html=False, include_plotlyjs=True, config={"responsive": True})
        parts += ["<h2>Sigma of every coefficient against time</h2>"]
        parts += ['<p class="quiet">Closed-loop pass. Grey: the table turns, no measurements.</p>', figure]
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        f"<style>{_STYLE}</style></head><body>\n" + "\n".join(parts) + "\n</body></html>\n"
    )


def _summary(calibration: Calibration) -> str:
    data = calibration.data
    words = [
        f"{data['duration_s'] / 60.0:.1f} min" if "duration_s" in data else "",
        *(f"{data[key]:.0f} {key}" for key in ("stops", "samples", "lost", "rejected") if key in data),
        f"{len(calibration.names)} coefficients of {len(calibration.model)} effects",
    ]
    return escape(" · ".join(word for word in words if word))


def _fit(calibration: Calibration) -> str:
    """Say what the fit figures mean; no verdict without a diagnosis."""
    nis, dof = calibration.fit.get("nis_mean"), calibration.fit.get("nis_dof")
    held_out = calibration.fit.get("held_out_rms")
    sentences = []
    if nis is not None and dof:
        sentences.append(f"Squared innovations are {nis:.3f} times what the noise explains ({dof:.0f} in number).")
    if held_out is not None:
        sentences.append(f"Stops that the fit has not seen are predicted to {held_out:.2f} sigma (RMS); 1 is right.")
    return escape(" ".join(sentences) or "Not computed.")


def _notes(calibration: Calibration) -> str:
    if not calibration.notes:
        return ""
    return "<ul>" + "".join(f"<li>{escape(note)}</li>" for note in calibration.notes) + "</ul>"


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
