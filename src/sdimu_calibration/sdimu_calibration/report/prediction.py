"""Tables and the page of a covariance simulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from sdimu_calibration.core.plain_text import three
from sdimu_calibration.core.planning.predict import Prediction
from sdimu_calibration.core.results import Calibration, History
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.design.sheet import document
from sdimu_calibration.report.drawing import html
from sdimu_calibration.report.figures import sigma_history
from sdimu_calibration.report.groups import groups
from sdimu_calibration.report.markup import grid, quiet, section
from sdimu_calibration.storage.files.whole_file import write_whole

_DEFINED = 1e-6
"""A sigma below this share of the prior is rounding: the body frame makes the coefficient zero."""


def coefficient_rows(prediction: Prediction) -> list[tuple[str, ...]]:
    """Name, prior, sigmas in white and in all noise, bound, sigma over bound and unit of every coefficient, as text."""
    rows: list[tuple[str, ...]] = []
    for k, name in enumerate(prediction.names):
        unit = prediction.display_units[k]
        sigma, bound, in_noise = prediction.sigma[k], prediction.bound[k], prediction.in_noise[k]
        defined = sigma < _DEFINED * prediction.prior[k]
        over = "" if defined or not np.isfinite(bound) else f"{sigma / bound:.2f}"
        rows.append(
            (
                name,
                _short(from_si(prediction.prior[k], unit)),
                "0" if defined else _short(from_si(sigma, unit)),
                "0" if defined else _short(from_si(in_noise, unit)),
                "0" if defined else _short(from_si(bound, unit)),
                over,
                unit,
            )
        )
    return rows


COLUMNS = ("coefficient", "prior", "sigma", "in its noise", "bound", "sigma / bound", "unit")


def published_rows(
    found: Mapping[str, Mapping[str, float]], printed: Mapping[str, Mapping[str, float]], units: Mapping[str, str]
) -> list[tuple[str, ...]]:
    """One row an effect: for every column "here (printed)", then the largest deviation in percent, then the unit.

    `found`, `printed`: largest sigma of the axes (SI); `units`: display unit by effect.
    """
    rows = []
    for effect, unit in units.items():
        cells, worst = [], 0.0
        for column, values in printed.items():
            here, there = found[column][effect], values[effect]
            worst = max(worst, abs(here / there - 1.0), key=abs)
            cells.append(f"  {_short(from_si(here, unit))} ({_short(from_si(there, unit))})")
        rows.append((effect, *cells, f"{100.0 * worst:.0f} %", unit))
    return rows


def write_page(
    path: Path,
    prediction: Prediction,
    about: Mapping[str, Any],
    published: tuple[Sequence[str], Sequence[Sequence[str]]] | None = None,
) -> None:
    """Write prediction.html: one file that needs no network.

    `about`: of what: shown in the heading; `published`: table beside published values.
    """
    write_whole(path, page(prediction, about, published))


def page(
    prediction: Prediction,
    about: Mapping[str, Any],
    published: tuple[Sequence[str], Sequence[Sequence[str]]] | None = None,
) -> str:
    """Make the page as HTML text; parameters as in `write_page`."""
    heading = f"Prediction of plan {about.get('plan', '')}"
    words = [f"{key.replace('_', ' ')}: {value}" for key, value in about.items() if key != "plan"]
    words.append(f"{prediction.duration_s / 60.0:.1f} min")
    parts = []
    if published is not None:
        columns, rows = published
        heads = ("largest of the axes", *columns, "off by", "unit")
        table = grid(heads, rows, {0, len(heads) - 1})
        parts.append(section("Beside the published values", table, quiet("In brackets: as printed.")))
    figure = html(sigma_history(as_history(prediction)), 1)
    told = quiet("In white noise. Grey: the table turns.")
    parts += [
        section("Sigma of every coefficient against time", told, figure),
        section("At the end", grid(COLUMNS, coefficient_rows(prediction), {0, len(COLUMNS) - 1})),
        section("Not observable", _unobservable(prediction)),
    ]
    return document(heading, "\n".join(parts), under=escape(" · ".join(words)))


def as_history(prediction: Prediction) -> Calibration:
    """Put a prediction into the shape that the figures draw: sigmas without values."""
    m, p = prediction.history.shape
    none = np.zeros((m, p))
    stop = np.zeros(m, dtype=np.int64)
    history = History(
        prediction.t,
        none,
        prediction.history,
        prediction.attitude,
        stop,
        prediction.dwell,
        prediction.dwell,
        np.zeros((m, 4)),
    )
    return Calibration(
        prediction.body_frame,
        prediction.model,
        prediction.names,
        prediction.units,
        prediction.display_units,
        np.zeros(p),
        prediction.covariance,
        {},
        {},
        (),
        history,
    )


def display_units(prediction: Prediction) -> dict[str, str]:
    """Display unit of each effect."""
    return {
        effect: prediction.display_units[rows[0]] for effect, rows in groups(prediction.names, prediction.model).items()
    }


def _unobservable(prediction: Prediction) -> str:
    if not prediction.unobservable:
        return "<p>Everything is seen better than the prior knew it.</p>"
    items = (
        f"<li>{escape(c.text)} ({100.0 * c.left:.0f} % of the prior variance is left)</li>"
        for c in prediction.unobservable
    )
    return f"<ul>{''.join(items)}</ul>"


def _short(value: float) -> str:
    return three(value) if np.isfinite(value) else ""
