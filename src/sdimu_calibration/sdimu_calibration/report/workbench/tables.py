"""Tables of the workbench: the models of a page side by side, and the coefficients that moved."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from dash import html

from sdimu_calibration.core.diagnosis.ladder import moved_coefficients
from sdimu_calibration.core.error_figures import log_likelihood
from sdimu_calibration.core.units import from_si, parse_quantity
from sdimu_calibration.report.table import as_far
from sdimu_calibration.report.workbench.elements import table
from sdimu_calibration.report.workbench.fit import FitSession, Fitted
from sdimu_calibration.report.workbench.own_effect import named
from sdimu_calibration.report.workbench.parts import span
from sdimu_calibration.report.workbench.setting import Setting

_HEADINGS = (
    "model",
    "log-likelihood",
    "against the model as given",
    "NIS",
    "one stop left out",
    "what is left out",
    "moved most",
)


def models(bench: FitSession, settings: Sequence[Setting], here: Setting) -> Any:
    """Compare the models of a page; a mark points at the one shown.

    A model is compared with the one as given, fitted to the same measurements.
    """
    found = [(setting, bench.known(setting)) for setting in settings]
    rows: list[tuple[Setting, Fitted]] = [(setting, fitted) for setting, fitted in found if fitted is not None]
    return table(
        _HEADINGS,
        (
            html.Tr(
                [html.Td(text) for text in _model(setting, fitted, bench.known(setting.given))],
                className="here" if setting == here else "",
            )
            for setting, fitted in rows
        ),
    )


def _model(setting: Setting, fitted: Fitted, given: Fitted | None) -> list[str]:
    fit = fitted.calibration.fit
    gained, most = "", ""
    if given is not None and given is not fitted:
        gained = f"{log_likelihood(fitted.calibration) - log_likelihood(given.calibration):+.1f}"
        sizes = moved_coefficients(given.calibration, fitted.calibration)[:2]
        most = ", ".join(f"{name} {size:+.1f} sigma" for name, size in sizes)
    return [
        described(setting),
        f"{fit['log_likelihood']:.1f}",
        gained,
        f"{fit['nis_mean']:.3f}",
        f"{fitted.held_out:.3f}",
        "" if fitted.at_held is None else f"{fitted.at_held:.3f}",
        most,
    ]


def described(setting: Setting) -> str:
    """Say in a line what a setting fits."""
    out = " ".join(f"+ {named(text)}" for text in setting.added) or "model as given"
    out += f" without stops {', '.join(map(str, setting.held))}" if setting.held else ""
    out += f" without {', '.join(map(span, setting.cut))} s" if setting.cut else ""
    priors = (f"{name} {'=' if _is_zero(sigma) else 'about'} {mean}" for name, mean, sigma in setting.priors)
    return "; ".join([out, *priors])


def _is_zero(quantity: str) -> bool:
    return parse_quantity(quantity, quantity.partition(" ")[2] or "1") == 0.0


def edited(now: Fitted, name: str) -> tuple[str, str]:
    """Estimate and sigma of a coefficient with their unit, as the controls of a prior take them; empty if unknown."""
    here = now.calibration
    if name not in here.names:
        return "", ""
    k = here.names.index(name)
    unit = here.display_units[k]
    value, sigma = from_si(float(here.values[k]), unit), from_si(float(np.sqrt(here.covariance[k, k])), unit)
    if not sigma > 0.0:
        return f"{value:.6g} {unit}", f"{from_si(float(now.prior[k]), unit):.3g} {unit}"
    return f"{as_far([value], sigma)[0]} {unit}", f"{sigma:.2g} {unit}"


def coefficients(given: Fitted, now: Fitted, setting: Setting) -> Any:
    """Table of all coefficients: value, sigma and prior, and how far each moved against the model as given."""
    first, here = given.calibration, now.calibration
    sigma, at = np.sqrt(np.diag(here.covariance)), {name: k for k, name in enumerate(first.names)}
    changed = {name for name, _, _ in setting.priors}
    headings = ("coefficient", "value", "sigma", "unit", "prior", "state", "as given", "moved (sigma as given)")
    rows = []
    for k, name in enumerate(here.names):
        unit = here.display_units[k]
        value, spread, prior, mean = (
            from_si(float(v), unit) for v in (here.values[k], sigma[k], now.prior[k], now.mean[k])
        )
        before, moved = "", ""
        if name in at and sigma[k] > 0.0 and first.covariance[at[name], at[name]] > 0.0:
            before = as_far([from_si(float(first.values[at[name]]), unit)], spread)[0]
            j = at[name]
            moved = f"{(here.values[k] - first.values[j]) / np.sqrt(first.covariance[j, j]):+.1f}"
        known = f"{value:.6g}" if now.prior[k] == 0.0 else "0"
        numbers = as_far([value, spread], spread) if spread > 0.0 else [known, "0"]
        state = "fixed" if now.prior[k] == 0.0 else "by the frame" if not sigma[k] > 0.0 else "free"
        shown = f"{mean:.4g} \N{PLUS-MINUS SIGN} {prior:.4g}" if mean else f"\N{PLUS-MINUS SIGN} {prior:.4g}"
        cells = [name, *numbers, unit, shown, f"{state}, own prior" if name in changed and state == "free" else state]
        rows.append(
            html.Tr(
                [
                    html.Td(html.Button(name, className="row", title="edit it")),
                    *map(html.Td, (*cells[1:], before, moved)),
                ],
                **{"data-coefficient": name},
            )
        )
    return table(headings, rows)
