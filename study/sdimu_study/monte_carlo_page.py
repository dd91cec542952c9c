"""A Monte-Carlo campaign for people: tables for the terminal, and a page that needs no network.

Works on the content of the data file (``sdimu-monte-carlo/1``), wherever its runs came from.
"""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.table import Table
from scipy import stats

from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.design.sheet import document
from sdimu_calibration.report.drawing import BAND, INK, Figure, html, lay_out
from sdimu_calibration.report.markup import grid, quiet, section, sentence
from sdimu_calibration.storage.files.json_file import read_json
from sdimu_calibration.storage.files.whole_file import write_whole

FORMAT = "sdimu-monte-carlo/1"

_INK, _WARN = "@after", "@bad"

_COLUMNS = ("coefficient", "bias", "+-", "RMS error", "sigma", "bound", "unit", "RMS / sigma", "RMS / bound")
_CHECK_COLUMNS = ("check", "value", "interval", "passed")


def cells(coefficient: Mapping[str, Any]) -> list[str]:
    """Texts of one coefficient under the columns of the table, in customary units."""
    unit = coefficient["display_unit"]
    values = [from_si(coefficient[key], unit) for key in ("bias", "bias_error", "rms", "sigma", "bound")]
    ratio = coefficient["rms"] / coefficient["bound"]
    return [
        coefficient["name"],
        f"{values[0]:+.2g}",
        *(f"{v:.2g}" for v in values[1:2]),
        *(f"{v:.3g}" for v in values[2:]),
        unit,
        f"{coefficient['rms_z']:.3f}",
        f"{ratio:.3f}",
    ]


def coefficients_table(content: Mapping[str, Any]) -> Table:
    """Lay the coefficients out for a terminal."""
    title = f"{content['runs']} runs; bound: {content['bound_from']}"
    return _laid(_COLUMNS, [cells(c) for c in content["coefficients"]], {0, 6}, title)


def check_cells(check: Mapping[str, Any]) -> list[str]:
    """Texts of one check: name, value, interval, verdict."""
    return [
        check["name"],
        f"{check['value']:.4g}",
        f"{check['low']:.4g} ... {check['high']:.4g}",
        "yes" if check["passed"] else "NO",
    ]


def checks_table(content: Mapping[str, Any]) -> Table:
    """Lay the checks out for a terminal."""
    return _laid(_CHECK_COLUMNS, [check_cells(check) for check in content["checks"]], {0}, None)


def _laid(columns: tuple[str, ...], lines: list[list[str]], text: set[int], title: str | None) -> Table:
    table = Table(title=title, title_justify="left", pad_edge=False, box=SIMPLE_HEAD)
    for k, column in enumerate(columns):
        # A narrow terminal may wrap lines; it must not cut digits.
        width = max(len(cell) for cell in (column, *(line[k] for line in lines)))
        table.add_column(column, justify="left" if k in text else "right", min_width=width)
    for line in lines:
        table.add_row(*line)
    return table


def write_page(path: Path, data: Path) -> None:
    """Write the page of a campaign from its data file."""
    text = page(read_json(data, FORMAT))
    write_whole(path, text)


def page(content: Mapping[str, Any]) -> str:
    """Make the page as HTML text."""
    runs, lost, slow = content["runs"], content["failed"], content.get("unconverged", [])
    bad = [c["name"] for c in content["checks"] if not c["passed"]]
    verdict = f"{len(bad)} of {len(content['checks'])} checks failed." if bad else "All checks passed."
    heading = f"Monte-Carlo campaign of {runs} runs"
    figure = html(figures(content), 1)
    told = f"Intervals hold {100 * content['level']:.0f} % of what a right estimator gives."
    unconverged = "Runs that took all passes and may not have converged"
    parts = [
        f'<div class="verdict {"bad" if bad else "good"}"><p class="head">{verdict}</p></div>',
        section("Checks", grid(_CHECK_COLUMNS, [check_cells(c) for c in content["checks"]], {0}), quiet(told)),
        section(
            "Coefficients",
            grid(_COLUMNS, [cells(c) for c in content["coefficients"]], {0, 6}),
            quiet(f"RMS over the runs; bound: {content['bound_from']}."),
        ),
        section("Distributions", figure),
        section(unconverged, sentence(f"seeds {', '.join(map(str, slow))}")) if slow else "",
        section("Failed runs", *(sentence(f"seed {run['seed']}: {run['error']}") for run in lost)) if lost else "",
    ]
    words = (
        f"body frame: {str(content['body_frame']).replace('_', ' ')}",
        f"{content['time']['cpu_s_per_run']:.2f} s of processor a run",
        f"{len(lost)} failed",
    )
    return document(heading, "\n".join(part for part in parts if part), under=escape(" · ".join(words)))


def figures(content: Mapping[str, Any]) -> Figure:
    """Four panels: error over sigma, bias, NEES, autocorrelation; grey is where a right estimator falls."""
    titles = ("RMS of error over sigma", "bias in standard errors", "NEES of the runs", "lag-1 autocorrelation")
    figure = Figure(rows=2, cols=2, titles=titles, gap_y=0.3, gap_x=0.1)
    names = [c["name"] for c in content["coefficients"]]
    _dots(figure, names, [c["rms_z"] for c in content["coefficients"]], content["rms_z_interval"], (1, 1))
    bias = content["checks"][0]["high"]
    _dots(figure, names, [c["bias"] / c["bias_error"] for c in content["coefficients"]], (-bias, bias), (1, 2))
    _nees(figure, content["nees"], (2, 1))
    measured = [a for a in content["autocorrelation"] if a["pairs"]]
    limit = content["checks"][-1]["high"] / np.sqrt(min((a["pairs"] for a in measured), default=1))
    _dots(figure, [a["channel"] for a in measured], [a["value"] for a in measured], (-limit, limit), (2, 2))
    return lay_out(figure, 900, margin={"l": 60, "r": 20, "t": 40, "b": 130}, font={"size": 12})


def _dots(figure: Figure, names: list[str], values: list[float], interval: Any, place: tuple[int, int]) -> None:
    low, high = interval
    inside = [low <= value <= high for value in values]
    row, col = place
    marker = {
        "color": [_INK if ok else _WARN for ok in inside],
        "size": 8,
        "symbol": ["circle" if ok else "x" for ok in inside],
    }
    figure.add("scatter", x=names, y=values, mode="markers", marker=marker, row=row, col=col)
    figure.shape("rect", y0=low, y1=high, fillcolor=BAND, line={"width": 0}, layer="below", row=row, col=col)
    figure.x_axes(tickangle=-60, row=row, col=col)


def _nees(figure: Figure, nees: Mapping[str, Any], place: tuple[int, int]) -> None:
    """Histogram of the NEES with the chi-square density that it should have."""
    dof = nees["dof"]
    values = np.asarray([v for v in nees["values"] if v is not None], dtype=float)
    x = np.linspace(max(0.0, dof - 4.5 * np.sqrt(2 * dof)), dof + 6.0 * np.sqrt(2 * dof), 200)
    row, col = place
    figure.add(
        "histogram", x=values, histnorm="probability density", marker={"color": _INK}, opacity=0.5, row=row, col=col
    )
    figure.add("scatter", x=x, y=stats.chi2.pdf(x, dof), mode="lines", line={"color": INK}, row=row, col=col)
    figure.x_axes(title=f"chi-square of {dof} degrees of freedom (line)", row=row, col=col)
