"""fleet.html: one file that needs no network."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

from sdimu_calibration.core.effect_key import effect_of
from sdimu_calibration.core.fleet.study import Candidates, Study
from sdimu_calibration.report.design.sheet import document
from sdimu_calibration.report.drawing import html
from sdimu_calibration.report.fleet import tables
from sdimu_calibration.report.fleet.dots import dot_plot
from sdimu_calibration.report.fleet.figures import control_chart, heat_map
from sdimu_calibration.report.groups import title as words_of
from sdimu_calibration.report.markup import grid, prose, quiet, section, signs
from sdimu_calibration.storage.files.fleet_folder import Gathered
from sdimu_calibration.storage.files.whole_file import write_whole

_MOST_COMMON, _MOST_TRENDS = 12, 12
"""Rows of a table that are shown though nothing stands out in them."""
_SORT = """
document.querySelectorAll('table').forEach(function (table) {
  var heads = table.querySelectorAll('thead th'), body = table.querySelector('tbody');
  function value(row, k) { return row.children[k].textContent.replace('<', '').replace('\\u2212', '-'); }
  heads.forEach(function (head, k) {
    head.tabIndex = 0; head.style.cursor = 'pointer'; head.title = 'sort';
    function sort() {
      var down = head.getAttribute('aria-sort') === 'ascending';
      heads.forEach(function (other) { other.removeAttribute('aria-sort'); });
      head.setAttribute('aria-sort', down ? 'descending' : 'ascending');
      Array.from(body.rows).sort(function (a, b) {
        var left = value(a, k), right = value(b, k), x = parseFloat(left), y = parseFloat(right);
        var order = isNaN(x) || isNaN(y) ? left.localeCompare(right) : x - y;
        return down ? -order : order;
      }).forEach(function (row) { body.appendChild(row); });
    }
    head.addEventListener('click', sort);
    head.addEventListener('keydown', function (event) { if (event.key === 'Enter') { sort(); } });
  });
});
"""


def display_units(gathered: Gathered, candidates: Candidates) -> dict[str, str]:
    """Customary unit of every coefficient and candidate."""
    first = gathered.entries[0].result
    return dict(zip(candidates.names, candidates.display_units, strict=True)) | dict(
        zip(first.names, first.display_units, strict=True)
    )


def headline(gathered: Gathered, done: Study) -> str:
    """How many results of which units are compared."""
    first = gathered.entries[0].result
    counted = f"{len(gathered.entries)} results of {len(done.people.units)} units"
    return f"{counted} · IMU {first.origin.imu or 'not known'} · {len(first.model)} effects · {first.body_frame}"


def write_page(path: Path, gathered: Gathered, done: Study, candidates: Candidates, title: str) -> None:
    """Write fleet.html. `candidates`: for their units; `title`: heading of the page."""
    units = display_units(gathered, candidates)
    kind = "bad" if done.people.out else "good"
    sentences = "<br>".join(prose(signs(one)) for one in tables.sentences(done, units))
    told = f'<div class="verdict {kind}">{sentences}</div>'
    parts = [
        section(
            "Every unit in every coefficient",
            quiet(
                "A dot for each unit, in spreads from the mean of the units"
                + (" that are not out" if done.people.out else "")
                + "; with its name: beyond the control limits (dashed, 3 spreads)"
                + ("; a cross or a filled arrow: out." if done.people.out else ".")
                + _without_spread(done)
            ),
            html(dot_plot(done, units), 0),
        ),
        _coefficients(done, units),
        section(
            "Units against the population of the others",
            quiet(
                "Deviate of each unit in sigmas of the others' spread, its own error included; a cross: out, over "
                "all units and coefficients together."
            ),
            html(heat_map(done), 1),
        ),
        _common(done, units),
        _trends(gathered, done, units),
        _apart(gathered.apart),
    ]
    body = "\n".join(part for part in (told, *parts) if part)
    write_whole(path, document(title, body, under=prose(headline(gathered, done)), script=_SORT))


def _without_spread(done: Study) -> str:
    """Say of coefficients whose units do not differ that they have no control limits; empty where all differ."""
    if all(one.between.spread > 0.0 for one in done.inside.coefficients):
        return ""
    return (
        " A coefficient in which no spread is seen has no control limits: its distances are in errors of the units "
        "(root mean square)."
    )


def _coefficients(done: Study, units: dict[str, str]) -> str:
    repeats = any(one.within is not None for one in done.people.coefficients)
    keep = [k for k, word in enumerate(tables.HEADINGS) if repeats or word != "within"]
    lines = [[row[k] for k in keep] for row in tables.rows(done, units)]
    heads = [tables.HEADINGS[k].replace("+-", "\N{PLUS-MINUS SIGN}") for k in keep]
    return section(
        "Coefficients over units",
        quiet(
            "Mean with half its 95 % interval, spread between units (REML) with its 95 % interval"
            + (", what results of one unit vary (within)" if repeats else "")
            + "; p: if units differed by their errors alone. Click on a heading to sort."
        ),
        grid(heads, lines, {0, 1, len(heads) - 1}),
    )


def _common(done: Study, units: dict[str, str]) -> str:
    lines = tables.common_rows(done, units, _MOST_COMMON)
    if not lines:
        return ""
    heads = [word.replace("+-", "\N{PLUS-MINUS SIGN}") for word in tables.COMMON_HEADINGS]
    return section(
        "Effects common to the type",
        quiet(
            "Each effect alone beside the model of each unit; p: if neither its mean over units nor its variance "
            "were there; q: the rate of false discoveries at which it is named (5 %)."
        ),
        grid(heads, lines, {0, 1, 9}),
    )


def _trends(gathered: Gathered, done: Study, units: dict[str, str]) -> str:
    model = gathered.entries[0].result.model
    effects: dict[str, list[int]] = {}
    for k, one in enumerate(done.people.coefficients):
        effects.setdefault(effect_of(one.name, model), []).append(k)
    charts = []
    for number, (effect, places) in enumerate(effects.items(), start=2):
        some = [done.inside.coefficients[k] for k in places]
        figure = control_chart(done.fleet, some, units, effect.partition("(")[0])
        charts += [f"<h3>{escape(words_of(effect))}</h3>", html(figure, number)]
    lines = tables.trend_rows(done, units, _MOST_TRENDS)
    heads = [word.replace("+-", "\N{PLUS-MINUS SIGN}") for word in tables.TREND_HEADINGS]
    return section(
        "Trends and control limits",
        grid(heads, lines, {0, 1, 4, 7}) if lines else quiet("No slopes: the results are of one date, or too few."),
        quiet(
            "Every result with one sigma; blue: mean of the units; dashed: mean +- 3 spreads"
            + (", without the units that are out." if done.people.out else ".")
        ),
        *charts,
    )


def _apart(lines: Sequence[str]) -> str:
    if not lines:
        return ""
    return section("Set apart", "<ul>" + "".join(f"<li>{prose(line)}</li>" for line in lines) + "</ul>")
