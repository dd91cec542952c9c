"""The section of coefficients: by sensor and effect, rounded by their sigma, beside what was known before."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import ACCEL, GYRO
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.site_reference import relative_line
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report import table
from sdimu_calibration.report.drawing import AFTER, Figure, lay_out, literal
from sdimu_calibration.report.effect_words import effect_of_key, tip, title_of
from sdimu_calibration.report.figures import sigma_history
from sdimu_calibration.report.groups import free
from sdimu_calibration.report.markup import Draw, folded, quiet, section, signs
from sdimu_calibration.report.sections import separation
from sdimu_calibration.report.statistics_section import influence_part
from sdimu_calibration.report.table import Row

_TEXT = frozenset({"coefficient", "unit"})
_TRIADS = ("Gyros", "Accelerometers", "Others")
_MOST_COLUMNS = 6
_MOST_LETTERS = 27
"""Columns and letters of a name up to which two tables stand beside each other on a screen of 1280 pixels."""


def coefficients_section(
    calibration: Calibration,
    fit: Fit | None,
    truth: Mapping[str, float] | None,
    reference: Mapping[str, float] | None,
    lacking: Sequence[str],
    draw: Draw,
) -> str:
    """Return the table with what belongs to it: prior against posterior, correlations, history, influence of stops.

    `lacking` are the coefficients that the diagnosis found and that these do not have.
    """
    prior = priors(fit)
    entries = table.rows(calibration, truth, reference, prior)
    copies = {"YAML": as_yaml(entries, calibration.body_frame), "CSV": as_csv(entries)}
    buttons = "".join(f'<button data-copy="copy-{kind}">Copy as {kind}</button> ' for kind in copies)
    texts = "".join(
        f'<textarea id="copy-{kind}" aria-label="{kind}" hidden readonly>{escape(text)}</textarea>'
        for kind, text in copies.items()
    )
    drawn = [folded("Prior against posterior", draw(prior_and_posterior(calibration, prior)))] if prior else []
    drawn.append(folded("What is hard to separate: correlations", separation(calibration, draw)))
    if isinstance(fit, NavigationFit):
        drawn.append(influence_part(fit, draw))
    if len(calibration.history.t):
        wider = " The sigmas of the table are over all models that the data leave open."
        alone = "" if calibration.conditional_sigma is None else wider
        told = quiet(f"Last pass, in this model. Grey: the table turns, no measurements.{alone}")
        drawn.append(folded("Sigma of every coefficient against time", told, draw(sigma_history(calibration))))
    told = f"Of the model as given, which lacks {escape(', '.join(lacking))}: these are off as the first screen says."
    return section(
        "Coefficients",
        f'<p class="lacking">{told}</p>' if lacking else "",
        *(quiet(f"Without {name}, which is left out: {why}.") for name, why in _left_out(calibration)),
        f"<p>{buttons}{texts}</p>",
        grouped_table(entries),
        quiet(
            f"One sigma; body frame: {calibration.body_frame.replace('_', ' ')}. Fixed: zero by the choice of that "
            "frame. Prior: one sigma of the IMU's file. A heading shows its equation under the mouse."
        ),
        *((quiet(f"These {at}."),) if (at := relative_line(calibration.references)) else ()),
        *drawn,
    )


def _left_out(calibration: Calibration) -> tuple[tuple[str, str], ...]:
    """Name the recordings of a set that could not be used, and why."""
    return () if calibration.of_set is None else calibration.of_set.left_out


def priors(fit: Fit | None) -> dict[str, float]:
    """One sigma (SI) that the IMU's file gives each coefficient; empty where no fit says it."""
    if fit is None:
        return {}
    evidence = fit.bare
    return dict(zip(evidence.names[: evidence.coefficients], evidence.stated.tolist(), strict=False))


def grouped_table(entries: Sequence[table.Row]) -> str:
    """Return the coefficients, those of the gyros beside those of the accelerometers; a heading for each effect."""
    columns = table.headings(list(entries))
    kinds = [' class="text"' if column in _TEXT else "" for column in columns]
    heads = [escape(column).replace("/", "/<wbr>") for column in columns]
    head = "".join(f'<th scope="col"{kind}>{word}</th>' for word, kind in zip(heads, kinds, strict=True))
    effects: dict[str, list[table.Row]] = {}
    for row in entries:
        effects.setdefault(row.effect, []).append(row)
    tables = []
    for triad in _TRIADS:
        lines = []
        for key, rows in effects.items():
            if _triad(key) != triad:
                continue
            words = tip(title_of(key), effect_of_key(key), [row.name for row in rows])
            lines.append(f'<tr class="group"><th colspan="{len(columns)}" scope="colgroup">{words}</th></tr>')
            lines += [_line(row, columns, kinds) for row in rows]
        if lines:
            tables.append(
                f'<div class="wide"><table><caption>{triad}</caption><thead><tr>{head}</tr></thead>'
                f"<tbody>{''.join(lines)}</tbody></table></div>"
            )
    broad = len(columns) > _MOST_COLUMNS or any(len(row.name) > _MOST_LETTERS for row in entries)
    return f'<div class="triads{" broad" if broad else ""}" id="coefficient-table">{"".join(tables)}</div>'


def _line(row: table.Row, columns: list[str], kinds: Sequence[str]) -> str:
    texts = zip(map(signs, table.cells(row, columns)), kinds, strict=True)
    return f'<tr id="c-{row.name}">' + "".join(f"<td{kind}>{escape(text)}</td>" for text, kind in texts) + "</tr>"


def _triad(key: str) -> str:
    effect = effect_of_key(key)
    channels = {term.channel for term in effect.terms} if effect else set()
    return (
        "Gyros"
        if channels and channels <= set(GYRO)
        else "Accelerometers"
        if channels and channels <= set(ACCEL)
        else "Others"
    )


def prior_and_posterior(calibration: Calibration, prior: Mapping[str, float]) -> Figure:
    """Estimate and sigma of each coefficient in sigmas of its prior; the band is the prior."""
    known = np.array([prior.get(name, 0.0) > 0.0 for name in calibration.names], dtype=bool)
    shown = np.flatnonzero(known & free(calibration)).tolist()
    names = [calibration.names[k] for k in shown]
    size = np.array([prior[name] for name in names])
    sigma: Floats = np.sqrt(np.diag(calibration.covariance))[shown] / size
    figure = Figure()
    figure.shade(x0=-1.0, x1=1.0)
    figure.add(
        "scatter",
        x=calibration.values[shown] / size,
        y=[literal(name) for name in names],
        mode="markers",
        marker={"color": AFTER, "size": 7},
        error_x={"array": sigma, "color": AFTER, "thickness": 1.5},
        text=[_words(calibration, k) for k in shown],
        hovertemplate="%{y}<br>%{text}<extra></extra>",
    )
    figure.x_axes(title="estimate (sigma of the prior)")
    figure.y_axes(range=[len(names) - 0.5, -0.5], title="coefficient", ticks="")
    return lay_out(figure, 18 * len(names) + 110, margin={"l": 60, "r": 20, "t": 20, "b": 55})


def _words(calibration: Calibration, k: int) -> str:
    unit = calibration.display_units[k]
    sigma = float(np.sqrt(calibration.covariance[k, k]))
    return table.with_sigma(from_si(float(calibration.values[k]), unit), from_si(sigma, unit), unit)


def as_yaml(rows: Sequence[Row], body_frame: str) -> str:
    """Coefficients as YAML: a map from name to value, sigma and unit."""
    lines = [f"body_frame: {body_frame}", "coefficients:"]
    lines += [
        f"  {row.name}: {{value: {row.value:.9g}, sigma: {row.sigma:.4g}, unit: {_quoted(row.unit)}}}" for row in rows
    ]
    return "\n".join(lines) + "\n"


def as_csv(rows: Sequence[Row]) -> str:
    """Coefficients as comma-separated values with a heading."""
    lines = ["name,value,sigma,unit", *(f"{row.name},{row.value:.9g},{row.sigma:.4g},{row.unit}" for row in rows)]
    return "\n".join(lines) + "\n"


def _quoted(unit: str) -> str:
    """Quote: "1" is a unit, not a number."""
    return f'"{unit}"'
