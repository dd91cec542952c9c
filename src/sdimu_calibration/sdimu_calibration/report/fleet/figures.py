"""Figures of a fleet: heat map of deviates, control charts over dates; its dots are in `dots`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime

import numpy as np

from sdimu_calibration.core.fleet.population import Coefficient, Measured
from sdimu_calibration.core.fleet.study import Study
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.design.palette import DIVERGING
from sdimu_calibration.report.drawing import AFTER, BEFORE, INK, Figure, lay_out, literal

_ROW, _FEWEST_PX = 24, 260
"""Height of a row of the heat map and of the least figure (px): names stay readable."""
_LARGEST = 6.0
"""Deviate (sigma) from which a cell has full colour: what is out in a fleet of ten."""
_PANELS = 3
"""Number of control charts side by side: as the axes of a triad."""

_MARGIN = 0.08
"""Share of the height of a chart beyond limits and values: they are seen to lie inside."""


def heat_map(done: Study) -> Figure:
    """Deviate of every unit in every coefficient from the population of the others."""
    people = done.people
    z = np.array([one.deviates for one in people.coefficients])
    figure = Figure()
    names = [literal(one.name) for one in people.coefficients]
    figure.add(
        "heatmap",
        x=[literal(unit) for unit in people.units],
        y=names,
        z=z,
        zmin=-_LARGEST,
        zmax=_LARGEST,
        xgap=1,
        ygap=1,
        colorscale=list(DIVERGING),
        colorbar={"title": {"text": "sigma"}},
        hovertemplate="%{x}<br>%{y}<br>%{z:.2f} sigma<extra></extra>",
    )
    for one in people.out:
        x, y = literal(one.unit), literal(one.coefficient)
        figure.annotate("<b>\N{MULTIPLICATION SIGN}</b>", x=x, y=y, font={"size": 14})
    figure.y_axes(autorange="reversed", automargin=True, type="category")
    figure.x_axes(type="category", side="top")
    return lay_out(figure, max(_FEWEST_PX, _ROW * len(names) + 110), margin={"l": 200, "r": 20, "t": 70, "b": 20})


def control_chart(fleet: Measured, some: Sequence[Coefficient], units: Mapping[str, str], heading: str) -> Figure:
    """Values of coefficients against the date, with mean and control limits; by number where dates are unknown.

    `some`: those of one effect; `units`: customary unit of each; `heading`: cut from the names above the panels.
    """
    rows = math.ceil(len(some) / _PANELS)
    titles = [literal(one.name.removeprefix(f"{heading}_")) for one in some]
    figure = Figure(rows=rows, cols=_PANELS, titles=titles, gap_x=0.07, gap_y=0.34 / rows)
    dated = bool(np.isfinite(fleet.dates_s).all() and np.ptp(fleet.dates_s) > 0.0)
    x = [_day(s) for s in fleet.dates_s] if dated else list(range(1, len(fleet.serials) + 1))
    for k, one in enumerate(some):
        place = {"row": 1 + k // _PANELS, "col": 1 + k % _PANELS}
        _panel(figure, fleet, one, units[one.name], x, place)
        # Panels of a row have one unit, but where an effect has several.
        if place["col"] == 1 or units[one.name] != units[some[0].name]:
            figure.y_axes(title=units[one.name], standoff=4, **place)
    for k in range(len(some), rows * _PANELS):
        figure.x_axes(visible=False, row=1 + k // _PANELS, col=1 + k % _PANELS)
        figure.y_axes(visible=False, row=1 + k // _PANELS, col=1 + k % _PANELS)
    figure.x_axes(row=rows, title="date" if dated else "result, as listed")
    return lay_out(figure, 90 + 190 * rows)


def _panel(
    figure: Figure, fleet: Measured, one: Coefficient, unit: str, x: Sequence[str | int], place: Mapping[str, int]
) -> None:
    k = fleet.names.index(one.name)
    factor = from_si(1.0, unit)
    limits = [factor * limit for limit in one.control_limits]
    mean = factor * one.between.mean
    figure.shape("line", y0=mean, y1=mean, line={"color": AFTER, "width": 1}, opacity=1, **place)
    for limit in limits:
        figure.shape("line", y0=limit, y1=limit, line={"color": BEFORE, "width": 1, "dash": "dash"}, opacity=1, **place)
    # Limits are no traces: by itself the axis ends at them.
    value, sigma = factor * fleet.values[:, k], factor * fleet.sigmas[:, k]
    low, high = min(limits[0], float((value - sigma).min())), max(limits[1], float((value + sigma).max()))
    figure.y_axes(range=[low - _MARGIN * (high - low), high + _MARGIN * (high - low)], **place)
    error = {"type": "data", "array": sigma, "thickness": 1, "width": 2}
    figure.add(
        "scatter",
        x=list(x),
        y=value,
        mode="markers",
        error_y=error,
        text=[literal(serial) for serial in fleet.serials],
        marker={"color": INK, "size": 6},
        hovertemplate="%{text}<br>%{x}<br>%{y:.4g} " + unit + "<extra></extra>",
        **place,
    )


def _day(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%d %H:%M:%S")
