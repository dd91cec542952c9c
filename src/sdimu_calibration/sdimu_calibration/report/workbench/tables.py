"""Tables of the workbench: the models of a page side by side, and the coefficients that moved."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from dash import html

from sdimu_calibration.core.diagnosis.ladder import moved_coefficients
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.table import as_far
from sdimu_calibration.report.workbench.fit import FitSession, Fitted, Key
from sdimu_calibration.report.workbench.own_effect import named

_STANDS = 0.01
"""Sigmas below which a coefficient has not moved."""
_HEADINGS = (
    "model", "log-likelihood", "against the model as given", "NIS", "held-out RMS", "at held-out stops", "moved most",
)  # fmt: skip


def models(bench: FitSession, keys: Sequence[Key], here: Key) -> Any:
    """Compare the models of a page; a mark points at the one shown.

    A model is compared with the one as given, fitted to the same stops.
    """
    found = [(key, bench.known(*key)) for key in keys]
    rows: list[tuple[Key, Fitted]] = [(key, fitted) for key, fitted in found if fitted is not None]
    return html.Table([
        html.Thead(html.Tr([html.Th(word) for word in _HEADINGS])),
        html.Tbody([
            html.Tr(
                [html.Td(text) for text in _model(key, fitted, bench.known((), key[1]))],
                className="here" if key == here else "",
            )
            for key, fitted in rows
        ]),
    ])  # fmt: skip


def _model(key: Key, fitted: Fitted, given: Fitted | None) -> list[str]:
    fit = fitted.calibration.fit
    gained, most = "", ""
    if given is not None and given is not fitted:
        gained = f"{(fit['log_likelihood'] or 0.0) - (given.calibration.fit['log_likelihood'] or 0.0):+.1f}"
        sizes = moved_coefficients(given.calibration, fitted.calibration)[:2]
        most = ", ".join(f"{name} {size:+.1f} sigma" for name, size in sizes)
    out = f" without stops {', '.join(map(str, key[1]))}" if key[1] else ""
    return [
        (" ".join(f"+ {named(text)}" for text in key[0]) or "model as given") + out,
        f"{fit['log_likelihood']:.1f}", gained, f"{fit['nis_mean']:.3f}",
        f"{fitted.held_out:.3f}", "" if fitted.at_held is None else f"{fitted.at_held:.3f}",
        most,
    ]  # fmt: skip


def moved(first: Calibration, now: Calibration, most: int = 8) -> Any:
    """Table of the coefficients that differ most between two fits, in sigmas of the later one."""
    at = {name: i for i, name in enumerate(first.names)}
    sigma = np.sqrt(np.diag(now.covariance))
    rows = []
    for i, name in enumerate(now.names):
        if name in at and sigma[i] > 0.0 and first.covariance[at[name], at[name]] > 0.0:
            rows.append((abs(now.values[i] - first.values[at[name]]) / sigma[i], i, at[name]))
    headings = ("coefficient", "as given", "now", "sigma", "unit", "moved (sigma)")
    cells = [html.Tr([html.Th(word) for word in headings])]
    for size, i, k in sorted(rows, reverse=True)[:most]:
        if size < _STANDS:
            break
        unit = now.display_units[i]
        numbers = [from_si(float(v), unit) for v in (first.values[k], now.values[i], sigma[i])]
        cells.append(html.Tr([
            html.Td(now.names[i]), *map(html.Td, as_far(numbers, numbers[-1])), html.Td(unit),
            html.Td(f"{size:.1f}"),
        ]))  # fmt: skip
    return html.Table(cells) if len(cells) > 1 else "none"
