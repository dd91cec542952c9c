"""The table of coefficients, in customary units."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from sdimu_calibration.core.effect_key import effect_of
from sdimu_calibration.core.plain_text import three
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.groups import free


@dataclass(frozen=True)
class Row:
    """A coefficient, in `unit`; None where there is nothing to say."""

    name: str
    effect: str
    unit: str
    value: float
    sigma: float
    """`value`, `sigma`: both zero when the body frame makes the coefficient zero by definition."""
    truth: float | None = None
    error: float | None = None
    error_sigmas: float | None = None
    """`truth`, `error`, `error_sigmas`: True value, estimate minus truth, and that over sigma."""
    reference: float | None = None
    """Published sigma of its group."""
    prior: float | None = None
    """One sigma by the IMU's file."""


def rows(
    calibration: Calibration,
    truth: Mapping[str, float] | None = None,
    reference: Mapping[str, float] | None = None,
    prior: Mapping[str, float] | None = None,
) -> list[Row]:
    """Make the rows of the table.

    Parameters
    ----------
    truth : mapping of str to float, optional
        True value (SI) by coefficient name, in the body frame of the calibration.
    reference : mapping of str to float, optional
        Published sigma (SI) by effect name.
    prior : mapping of str to float, optional
        One sigma (SI) by the IMU's file, by coefficient name.

    Returns
    -------
    list of Row
        In the order of the calibration.
    """
    sigmas = np.sqrt(np.diag(calibration.covariance))
    found = [
        _row(calibration, index, float(sigma), truth or {}, reference or {})
        for index, sigma in enumerate(np.where(free(calibration), sigmas, 0.0))
    ]
    known = prior or {}
    return [replace(row, prior=from_si(known[row.name], row.unit)) if row.name in known else row for row in found]


def _row(
    calibration: Calibration, index: int, sigma: float, truth: Mapping[str, float], reference: Mapping[str, float]
) -> Row:
    name, unit = calibration.names[index], calibration.display_units[index]
    value = float(calibration.values[index]) if sigma > 0 else 0.0
    effect = effect_of(name, calibration.model)
    true = truth.get(name)
    error = None if true is None else value - true
    published = reference.get(effect)
    return Row(
        name=name,
        effect=effect,
        unit=unit,
        value=from_si(value, unit),
        sigma=from_si(sigma, unit),
        truth=None if true is None else from_si(true, unit),
        error=None if error is None else from_si(error, unit),
        error_sigmas=error / sigma if error is not None and sigma > 0 else None,
        reference=None if published is None else from_si(published, unit),
    )


def headings(table: list[Row]) -> list[str]:
    """Column headings: those that have something to say."""
    columns = ["coefficient", "estimate", "sigma", "unit"]
    if any(row.prior is not None for row in table):
        columns += ["prior", "sigma / prior"]
    if any(row.truth is not None for row in table):
        columns += ["truth", "error", "error/sigma"]
    if any(row.reference is not None for row in table):
        columns += ["published sigma"]
    return columns


def cells(row: Row, columns: list[str]) -> list[str]:
    """Texts of a row under `columns`; estimate, truth and error go as far as sigma resolves."""
    decimals = _decimals(row.sigma)
    sigma = f"{row.sigma:.{decimals}f}" if row.sigma > 0 else "fixed"
    texts = {
        "coefficient": row.name,
        "estimate": f"{row.value:.{decimals}f}",
        "sigma": sigma,
        "unit": row.unit,
        "prior": "" if row.prior is None else three(row.prior),
        "sigma / prior": f"{100.0 * row.sigma / row.prior:.2g} %" if row.prior and row.sigma > 0 else "",
        "truth": _number(row.truth, decimals),
        "error": _number(row.error, decimals),
        "error/sigma": _number(row.error_sigmas, 2),
        "published sigma": "" if row.reference is None else three(row.reference),
    }
    return [texts[column] for column in columns]


def rich_table(table: list[Row], title: str | None = None) -> Table:
    """Lay the rows out for a terminal, a line between effects."""
    columns = headings(table)
    texts = [cells(row, columns) for row in table]
    heads = [column.replace("/", "/\n").replace(" ", "\n") for column in columns]
    laid = Table(title=title, title_justify="left", pad_edge=False, padding=(0, 1, 0, 0), box=SIMPLE_HEAD)
    for place, (column, head) in enumerate(zip(columns, heads, strict=True)):
        # A narrow terminal may wrap lines; it must not cut digits.
        width = max(len(text) for text in (*head.split("\n"), *(line[place] for line in texts)))
        laid.add_column(head, justify="left" if column in {"coefficient", "unit"} else "right", min_width=width)
    for row, line, following in zip(table, texts, [*table[1:], None], strict=True):
        laid.add_row(*line, end_section=following is not None and following.effect != row.effect)
    return laid


def as_text(table: Table, width: int) -> str:
    """Write a table as plain text; in a notebook, too, where rich would show it at once and return nothing."""
    text = io.StringIO()
    Console(file=text, width=width, color_system=None, force_jupyter=False).print(table)
    return text.getvalue()


def with_sigma(value: float, sigma: float, unit: str) -> str:
    """Write a value as far as its sigma resolves, two digits of it, as in ``39.7 +- 1.0 ppm``."""
    if not (math.isfinite(sigma) and sigma >= _SMALLEST_WRITTEN):
        shown, beside = f"{value:.3g}", f"{sigma:.2g}"
    else:
        shown, beside = as_far((value, sigma), sigma)
    return f"{shown.replace('-', _MINUS)} \N{PLUS-MINUS SIGN} {beside} {unit}"


def as_far(values: Sequence[float], sigma: float) -> list[str]:
    """Write numbers as far as a sigma resolves, two digits of it."""
    return [f"{value:.{_decimals(sigma)}f}" for value in values]


_MINUS = "\N{MINUS SIGN}"
_SMALLEST_WRITTEN = 1e-6
"""Below this, decimals are more zeros than number."""


def _decimals(sigma: float) -> int:
    """Decimals that show two digits of sigma."""
    if not math.isfinite(sigma) or sigma <= 0:
        return 0
    return max(0, 1 - math.floor(math.log10(sigma)))


def _number(value: float | None, decimals: int) -> str:
    return "" if value is None else f"{value:.{decimals}f}"
