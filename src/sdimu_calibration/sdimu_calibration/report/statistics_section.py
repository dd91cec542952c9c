"""What a statistician looks for, as figures and HTML text."""

from __future__ import annotations

from typing import Any

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import CHANNELS
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.report.drawing import INK, MUTED, Figure, lay_out
from sdimu_calibration.report.evidence_figures import deviates
from sdimu_calibration.report.markup import Draw, folded, quiet, section
from sdimu_calibration.report.statistics import KINDS, Influence, Whiteness, influences, whiteness

_INK = ("@x", "@y", "@gyro", "@accel")
_SYMBOL = ("circle", "square", "triangle-up", "diamond")
_AXIS_INK = ("@x", "@y", "@z")
_LEGEND = {"orientation": "h", "yanchor": "bottom", "y": 1.12, "x": 0}


def noise_section(fit: NavigationFit, draw: Draw) -> str:
    """Return histogram, QQ plot, NIS over time and autocorrelation of the innovations of a fit."""
    found = whiteness(fit)
    return section(
        "Noise: are the innovations white and normal?",
        quiet(
            "Whitened innovations of the last pass, with all coefficients of this page. A right model in right noise "
            "gives the normal curve, the diagonal, and points inside the bands (95 %)."
        ),
        draw(distribution(found)),
        draw(over_time(found)),
        folded("Autocorrelation of each sensor axis within the stops", draw(autocorrelation(found))),
    )


def influence_part(fit: NavigationFit, draw: Draw) -> str:
    """Return the map of what each stop does to each coefficient."""
    found = influences(fit)
    return folded(
        "Influence of each stop on each coefficient",
        quiet(
            "How far a coefficient moves, in its sigmas, when a stop and the turn before it are left out of the linear "
            "model. Beyond 2: the value hangs on that stop."
        ),
        draw(of_stops(found)),
    )


def distribution(found: Whiteness) -> Figure:
    """Histogram with the normal density, and QQ plot, one curve a kind of measurement."""
    figure = Figure(rows=1, cols=2, titles=("histogram", "quantiles"), gap_x=0.1)
    for k, kind in enumerate(KINDS):
        if not len(found.found[k]):
            continue
        look: dict[str, Any] = {"name": kind, "legendgroup": kind}
        figure.add(
            "scatter",
            x=found.bins,
            y=found.density[k],
            mode="lines",
            line={"color": _INK[k], "shape": "hvh"},
            hovertemplate="%{x:.2f} sigma: %{y:.3f}<extra>" + kind + "</extra>",
            **look,
        )
        figure.add(
            "scatter",
            x=found.expected[k],
            y=found.found[k],
            mode="markers",
            showlegend=False,
            col=2,
            marker={"color": _INK[k], "symbol": _SYMBOL[k], "size": 5},
            hovertemplate="normal %{x:.2f}, found %{y:.2f} sigma<extra>" + kind + "</extra>",
            **look,
        )
    figure.add(
        "scatter",
        x=found.bins,
        y=np.exp(-0.5 * found.bins**2) / np.sqrt(2.0 * np.pi),
        mode="lines",
        name="normal",
        line={"color": INK, "dash": "dash"},
    )
    ends = np.array([-4.0, 4.0])
    figure.add(
        "scatter",
        x=ends,
        y=ends,
        mode="lines",
        line={"color": INK, "dash": "dash"},
        showlegend=False,
        hoverinfo="skip",
        col=2,
    )
    figure.x_axes(title="innovation (sigma)", col=1)
    figure.y_axes(title="density (1/sigma)", col=1)
    figure.x_axes(title="normal quantile (sigma)", col=2)
    figure.y_axes(title="quantile found (sigma)", col=2)
    return lay_out(figure, 380, showlegend=True, legend=_LEGEND, margin={"l": 70, "r": 20, "t": 80, "b": 55})


def over_time(found: Whiteness) -> Figure:
    """Mean NIS of each stop with its band, a panel a kind of measurement."""
    figure = Figure(rows=1, cols=4, titles=KINDS, gap_x=0.05)
    for k in range(4):
        good = np.isfinite(found.nis[:, k])
        low, high = (np.where(good, v[:, k], np.nan)[good] for v in (found.low, found.high))
        t = found.t[good]
        figure.band(t, low, high, col=k + 1)
        figure.add(
            "scatter",
            x=t,
            y=found.nis[good, k],
            mode="markers",
            showlegend=False,
            col=k + 1,
            text=[str(s) for s in found.stop[good]],
            marker={"color": _INK[k], "symbol": _SYMBOL[k], "size": 7},
            hovertemplate="stop %{text}: %{y:.2f}<extra></extra>",
        )
        figure.shape("line", y0=1.0, y1=1.0, line={"color": MUTED, "dash": "dash", "width": 1}, col=k + 1)
        figure.x_axes(title="time (min)", col=k + 1)
    figure.y_axes(title="mean NIS of a stop (1)", col=1)
    return lay_out(figure, 300, margin={"l": 70, "r": 20, "t": 45, "b": 55})


def autocorrelation(found: Whiteness) -> Figure:
    """Autocorrelation of the six sensor axes with the band of white noise."""
    figure = Figure(
        rows=2,
        cols=3,
        titles=[name.replace("_", " ") for name in CHANNELS],
        gap_x=0.06,
        gap_y=0.2,
        share_x=True,
        share_y=True,
    )
    for channel in range(6):
        place = {"row": channel // 3 + 1, "col": channel % 3 + 1}
        figure.shade(y0=-found.band, y1=found.band, **place)
        figure.add(
            "bar",
            x=found.lags,
            y=found.correlation[:, channel],
            marker={"color": _AXIS_INK[channel % 3]},
            hovertemplate="lag %{x}: %{y:+.3f}<extra></extra>",
            **place,
        )
    figure.x_axes(title="lag (epochs)", row=2)
    figure.y_axes(title="correlation (1)", col=1)
    return lay_out(figure, 420, margin={"l": 70, "r": 20, "t": 45, "b": 55})


def of_stops(found: Influence) -> Figure:
    """Heat map of what each stop does to each coefficient."""
    order = _most_first(found.moved)
    return deviates(
        [str(s) for s in found.stops],
        [found.names[k] for k in order],
        found.moved.T[order],
        "stop",
        "coefficient",
        120 + 18 * len(order),
    )


def _most_first(moved: Floats) -> list[int]:
    """Columns of `moved` (s, k), that which a single stop moves most first."""
    return [int(k) for k in np.argsort(-np.abs(moved).max(axis=0))]
