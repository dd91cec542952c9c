"""datasheet.html: a page for a screen and for A4."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from html import escape
from pathlib import Path

from sdimu_calibration.core.fleet.sheet import FAIL, NOT_MEASURED, PASS, UNDECIDED, Line
from sdimu_calibration.core.plain_text import first_of
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.design.sheet import document
from sdimu_calibration.report.fleet.tables import three
from sdimu_calibration.report.markup import grid, prose, quiet, section, signs
from sdimu_calibration.report.table import cells
from sdimu_calibration.report.table import rows as coefficient_rows
from sdimu_calibration.storage.files.datasheet_file import Certificate
from sdimu_calibration.storage.files.fleet_folder import Entry
from sdimu_calibration.storage.files.whole_file import write_whole

HEADINGS = ("term", "value", "95 %", "unit", "n", "limit", "verdict")
_WORST_FIRST = (FAIL, UNDECIDED, NOT_MEASURED, PASS)
_COEFFICIENTS = ("coefficient", "estimate", "sigma", "unit")
_SHEET_STYLE = """
table.sheet td { white-space: normal; vertical-align: top; } table.sheet td.number { white-space: nowrap; }
td.pass, b.pass { color: var(--good); font-weight: bold; } td.fail, b.fail { color: var(--bad); font-weight: bold; }
ul.limits { list-style: none; padding: 0; margin: .4rem 0 0; font-variant-numeric: tabular-nums;
  display: flex; flex-wrap: wrap; gap: .1rem 2rem; }
@media (max-width: 1099px) {
  table.sheet th, table.sheet td { padding: .22rem .35rem; } table.sheet td.quiet { overflow-wrap: anywhere; }
}
td.undecided { font-weight: bold; } tr.group td { background: var(--sunken); font-weight: bold; text-align: left; }
.sign { display: flex; gap: 4em; margin-top: 4em; }
.sign div { border-top: 1px solid var(--ink); flex: 1; padding-top: .3em; break-inside: avoid; }
"""


def rows(lines: Sequence[Line], short: bool = False) -> list[list[str]]:
    """Rows of `HEADINGS`; `short` leaves what was not measured and has no limit out."""
    return [_row(line) for line in lines if not short or math.isfinite(line.value) or math.isfinite(line.limit)]


def _row(line: Line) -> list[str]:
    unit = line.display_unit
    bounds = f"{_size(line.low, unit)}..{_size(line.high, unit)}" if math.isfinite(line.high) else ""
    value = _size(line.value, unit) if math.isfinite(line.value) else ""
    if line.is_bound:
        value, bounds = f"< {_size(line.high, unit)}", ""
    limit = _size(line.limit, unit) if math.isfinite(line.limit) else ""
    return [line.term, value, bounds, unit, str(line.recordings or ""), limit, line.verdict]


def _size(value: float, unit: str) -> str:
    return three(from_si(value, unit))


def write_page(
    path: Path, lines: Sequence[Line], about: Certificate, entries: Sequence[Entry], certificate: bool
) -> None:
    """Write datasheet.html.

    `entries`: the results that it is made of. `certificate`: of one unit: with its coefficients, the hashes of its
    recordings and room for signatures.
    """
    imu = entries[0].result.origin.imu or "IMU"
    title = f"{'Calibration certificate' if certificate else 'Data sheet'}: {imu}, {_which(about, entries)}"
    parts = [
        _table(lines),
        _coefficients(entries) if certificate else "",
        _recordings(about, entries),
        _missing(lines),
        _signatures(about) if certificate else "",
    ]
    body = "\n".join(part for part in (_head(about, entries), _conditions(lines), _verdict(lines), *parts) if part)
    write_whole(path, document(title, body, style=_SHEET_STYLE))


_NAMED = 4
"""Number of units that the title names: more do not fit into it."""


def _which(about: Certificate, entries: Sequence[Entry]) -> str:
    """Name the units: the serial number where one is known, else the name of the result."""
    units = list(dict.fromkeys(entry.unit for entry in entries))
    if len(units) > 1:
        return f"{len(units)} units: {first_of(units, _NAMED)}"
    return f"serial {about.serial}" if about.serial else f"unit {units[0]} (no serial stated)"


def _head(about: Certificate, entries: Sequence[Entry]) -> str:
    units = len({entry.unit for entry in entries})
    words = [
        ("serial", about.serial),
        ("date", about.date),
        ("operator", about.operator),
        ("plan", about.plan),
        ("results", f"{len(entries)} of {units} unit{'s' if units > 1 else ''}"),
        ("body frame", entries[0].result.body_frame.replace("_", " ")),
        ("program", f"sdimu {about.version}"),
    ]
    return quiet(" \N{MIDDLE DOT} ".join(f"{key} {value}" for key, value in words if value))


def _same_conditions(lines: Sequence[Line]) -> str:
    """Conditions that all lines have; empty where they differ."""
    found = {line.condition for line in lines if line.condition}
    return found.pop() if len(found) == 1 else ""


def _conditions(lines: Sequence[Line]) -> str:
    same = _same_conditions(lines)
    return quiet(f"Test conditions: {same}.") if same else ""


def _verdict(lines: Sequence[Line]) -> str:
    judged = [line for line in lines if line.verdict]
    if not judged:
        return quiet("No limits were stated, so nothing passes or fails: --limits FILE holds the lines against them.")
    said = {kind: [line.term for line in judged if line.verdict == kind] for kind in _WORST_FIRST}
    bad = said[FAIL] or len(said[PASS]) < len(judged)
    counted = [
        f"{kind}: {', '.join(terms) if kind != PASS else f'{len(terms)} of {len(judged)} limits'}"
        for kind, terms in said.items()
        if terms
    ]
    text = f"{'. '.join(part.capitalize() for part in counted)}."
    rows = "".join(map(_limit, sorted(judged, key=lambda line: _WORST_FIRST.index(line.verdict))))
    head = f'<p class="head">{escape(text)}</p>'
    return f'<div class="verdict {"bad" if bad else "good"}">{head}<ul class="limits">{rows}</ul></div>'


def against_limit(line: Line) -> str:
    """Say what was measured beside what is allowed: ``gyro bias: 12 deg/h (limit 10)``."""
    _, value, _, unit, _, limit, _ = _row(line)
    return f"{line.term}: {f'{value} {unit} (limit {limit})' if value else f'limit {limit} {unit}'}"


def _limit(line: Line) -> str:
    """Return an item of the list of limits."""
    kind = line.verdict.split(" ")[0]
    return f'<li><b class="{kind}">{escape(line.verdict)}</b> {escape(signs(against_limit(line)))}</li>'


_JUDGED = ("limit", "verdict")
"""Columns of a sheet that is held against limits."""
_NUMBERS = frozenset({"value", "95 % interval", "rms", "n", "limit"})


def _table(lines: Sequence[Line]) -> str:
    """Lines that were measured or have a limit, gyros first."""
    body, same = [], _same_conditions(lines)
    shown = [line for line in lines if math.isfinite(line.value) or math.isfinite(line.limit)]
    judged = any(line.verdict for line in shown)
    heads = ("term", "value", "95 % interval", "unit", "rms", "n", *(_JUDGED if judged else ()), "how and where")
    for triad in ("gyro", "accelerometer"):
        own = [line for line in shown if line.term.startswith(f"{triad} ")]
        if own:
            body.append(f'<tr class="group"><td colspan="{len(heads)}">{triad}s</td></tr>')
        told = [line if line.condition != same else replace(line, condition="") for line in own]
        body += [_line(line, triad, judged) for line in told]
    # As the cells below: numbers stand flush right, words flush left.
    kinds = ["" if word in _NUMBERS else ' class="text"' for word in heads]
    head = "".join(f"<th{kind}>{escape(word)}</th>" for word, kind in zip(heads, kinds, strict=True))
    text = (
        "Value: the largest over axes and units, with its 95 % interval (all axes together); rms: over axes and units; "
        "n: recordings."
    ) + (" Pass: the whole interval is inside the limit; undecided: it straddles it." if judged else "")
    return section(
        "What was measured",
        quiet(text),
        f'<table class="sheet"><thead><tr>{head}</tr></thead><tbody>{"".join(body)}</tbody></table>',
    )


def _line(line: Line, triad: str, judged: bool) -> str:
    _, value, bounds, unit, number, limit, verdict = _row(line)
    rms = _size(line.rms, line.display_unit) if math.isfinite(line.rms) and not line.is_bound else ""
    how = "; ".join(word for word in (line.of, line.method, line.condition, line.missing) if word)
    texts = [
        (line.term.removeprefix(f"{triad} "), "text"),
        (value, "number"),
        (bounds.replace("..", " to "), "number"),
        (unit, "text number"),
        (rms, "number"),
        (number, "number"),
        *([(limit, "number"), (verdict, f"text {verdict.split(' ')[0]}")] if judged else []),
        (how, "text quiet"),
    ]
    return "<tr>" + "".join(f'<td class="{kind}">{escape(signs(text))}</td>' for text, kind in texts) + "</tr>"


def _missing(lines: Sequence[Line]) -> str:
    """Say what was not measured, and what would measure it."""
    out = [line for line in lines if not math.isfinite(line.value) and not math.isfinite(line.limit)]
    if not out:
        return ""
    return section("Not measured", grid(("term", "what would"), [[line.term, line.missing] for line in out], {0, 1}))


def _coefficients(entries: Sequence[Entry]) -> str:
    """Coefficients of the last result, as it stands in the compensation."""
    last = entries[-1]
    table = [cells(row, list(_COEFFICIENTS)) for row in coefficient_rows(last.result)]
    return section(
        "Coefficients",
        quiet(f"Of {last.name}, one sigma; what compensation takes out."),
        grid(_COEFFICIENTS, table, {0, 3}),
    )


def _recordings(about: Certificate, entries: Sequence[Entry]) -> str:
    lines = [
        [
            entry.name,
            entry.unit,
            origin.power_on,
            _date(origin.start_ns),
            origin.recording,
            "" if math.isnan(origin.temperature_degc) else f"{origin.temperature_degc:.1f}",
        ]
        for entry in entries
        for origin in (entry.result.origin,)
    ]
    table = grid(("result", "unit", "power-on", "start (UTC)", "recording", "deg C"), lines, {0, 1, 2, 3, 4})
    hashes = "".join(
        f"<li>{escape(name)}<br><code>{digest or 'not found, no hash'}</code></li>" for name, digest in about.recordings
    )
    return section("Results", table, f"<h2>SHA-256 of the recordings</h2><ul>{hashes}</ul>" if hashes else "")


def _date(start_ns: int) -> str:
    return datetime.fromtimestamp(1e-9 * start_ns, UTC).strftime("%Y-%m-%d %H:%M") if start_ns else ""


def _signatures(about: Certificate) -> str:
    return f'<div class="sign"><div>{prose(about.operator) or "operator"}</div><div>date</div><div>checked</div></div>'
