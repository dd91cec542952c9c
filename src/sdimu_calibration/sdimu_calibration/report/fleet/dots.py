"""The first figure of a fleet: a dot for each unit in each coefficient."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np

from sdimu_calibration.core.fleet.population import CONTROL, Coefficient
from sdimu_calibration.core.fleet.study import Study
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.drawing import AFTER, BEFORE, INK, Figure, lay_out, literal
from sdimu_calibration.report.table import with_sigma

_ROW, _FEWEST_PX = 24, 260
"""Height of a row and of the least figure (px): names stay readable."""
_REACH, _FARTHEST = 3.6, 8.0
"""Least half width of the axis (spreads), at which the control limits are in sight, and the largest distance that
widens it: a unit that is farther out would press the dots of all others together."""
_ROOM = 1.06
"""Half width of the figure as a multiple of the axis: a mark at its edge is whole."""


@dataclass(frozen=True)
class _Dot:
    """A unit in a coefficient."""

    unit: str
    coefficient: str
    spreads: float
    """Distance from the mean of the units that are not out (spreads)."""
    told: str
    """Value and sigma in the customary unit."""
    out: bool
    limited: bool
    """Whether its coefficient has control limits: a spread between units is seen. `spreads` are errors where not."""


def dot_plot(done: Study, units: Mapping[str, str]) -> Figure:
    """Draw a dot for each unit in each coefficient, in spreads from the mean of the units that are not out.

    A cross is out. Control limits are dashed; what lies beyond them has its name, and what is farther than the axis is
    an arrow at its edge, with its distance. A coefficient without a spread has no limits: they would be its mean.

    Parameters
    ----------
    done : Study
        Of the fleet; distances are from its population without the units that are out.
    units : mapping of str to str
        Customary unit of each coefficient.
    """
    dots = _dots(done, units)
    reach = max([_REACH, *(abs(dot.spreads) for dot in dots if abs(dot.spreads) <= _FARTHEST)])
    inside, out = [dot for dot in dots if not dot.out], [dot for dot in dots if dot.out]
    figure = Figure()
    _limit(figure, [core.between.spread > 0.0 for core in done.inside.coefficients])
    figure.shape("line", x0=0.0, x1=0.0, line={"color": INK, "width": 1}, opacity=1)
    _draw(figure, inside, reach, symbol="circle-open", size=9, color=AFTER)
    _draw(figure, out, reach, symbol="x", size=11, color=BEFORE)
    _name(figure, [dot for dot in dots if dot.out or (dot.limited and abs(dot.spreads) > CONTROL)], reach)
    names = [literal(one.name) for one in done.people.coefficients]
    # Above: thirty coefficients reach below the first screen.
    figure.x_axes(title="distance from the mean (spreads)", side="top", range=[-_ROOM * reach, _ROOM * reach])
    figure.y_axes(
        # By itself the axis would end at limits that are not of all rows. The first coefficient is on top.
        range=[len(names) - 0.5, -0.5],
        automargin=True,
        type="category",
        categoryorder="array",
        categoryarray=names,
        title="coefficient",
    )
    return lay_out(figure, max(_FEWEST_PX, _ROW * len(names) + 110), margin={"l": 200, "r": 20, "t": 60, "b": 20})


def _limit(figure: Figure, limited: list[bool]) -> None:
    """Draw control limits beside the coefficients that have some; `limited`: whether each has, from above."""
    rows = 0
    for has, run in groupby(limited):
        first, rows = rows, rows + len(list(run))
        # The first row is 0 and each reaches half a row to both sides.
        height: dict[str, Any] = {} if all(limited) else {"y0": first - 0.5, "y1": rows - 0.5}
        for x in (-CONTROL, CONTROL) if has else ():
            figure.shape("line", x0=x, x1=x, line={"color": BEFORE, "width": 1, "dash": "dash"}, opacity=1, **height)


def _dots(done: Study, units: Mapping[str, str]) -> list[_Dot]:
    """Measure each unit against the population without those that are out: what is out would widen its own scale."""
    out = {(one.unit, one.coefficient) for one in done.people.out}
    return [
        _Dot(
            unit,
            one.name,
            (value - core.between.mean) / _scale(core),
            told,
            (unit, one.name) in out,
            core.between.spread > 0.0,
        )
        for one, core in zip(done.people.coefficients, done.inside.coefficients, strict=True)
        for unit, value, told in zip(done.people.units, one.values.tolist(), _told(one, units[one.name]), strict=True)
    ]


def _told(one: Coefficient, unit: str) -> list[str]:
    pairs = zip(one.values.tolist(), one.sigmas.tolist(), strict=True)
    return [with_sigma(from_si(value, unit), from_si(sigma, unit), unit) for value, sigma in pairs]


def _scale(core: Coefficient) -> float:
    """Spread between units (SI); where none is seen, their root mean square error."""
    return core.between.spread if core.between.spread > 0.0 else float(np.sqrt(np.mean(core.sigmas**2)))


def _draw(figure: Figure, dots: list[_Dot], reach: float, symbol: str, size: int, color: str) -> None:
    symbols = [_arrow(dot) if abs(dot.spreads) > reach else symbol for dot in dots]
    figure.add(
        "scatter",
        x=np.array([max(-reach, min(reach, dot.spreads)) for dot in dots]),
        y=[literal(dot.coefficient) for dot in dots],
        text=[f"{literal(dot.unit)}<br>{literal(dot.coefficient)}: {dot.told}" for dot in dots],
        customdata=np.array([dot.spreads for dot in dots]),
        mode="markers",
        marker={"symbol": symbols, "size": size, "color": color, "line": {"width": 2}},
        cliponaxis=False,
        hovertemplate=[
            f"%{{text}}<br>%{{customdata:.2f}} {'spreads' if dot.limited else 'errors'} from the mean<extra></extra>"
            for dot in dots
        ],
    )


def _arrow(dot: _Dot) -> str:
    return f"triangle-{'right' if dot.spreads > 0.0 else 'left'}{'' if dot.out else '-open'}"


def _name(figure: Figure, some: Iterable[_Dot], reach: float) -> None:
    """Write the names of some dots, by turns above and below their marks: neighbours do not cover them.

    Those beyond the edge are named inwards, the farthest first, in one line with their distances.
    """
    rows: dict[str, list[_Dot]] = {}
    for dot in sorted(some, key=lambda dot: -abs(dot.spreads)):
        rows.setdefault(dot.coefficient, []).append(dot)
    for coefficient, dots in rows.items():
        y = literal(coefficient)
        for side, anchor in ((1.0, "right"), (-1.0, "left")):
            beyond = [dot for dot in dots if side * dot.spreads > reach]
            if beyond:
                text = ", ".join(f"{literal(dot.unit)} ({dot.spreads:+.0f})" for dot in beyond)
                figure.annotate(text, x=side * reach, y=y, xanchor=anchor, xshift=-10 * side, font={"size": 12})
        near = sorted((dot for dot in dots if abs(dot.spreads) <= reach), key=lambda dot: dot.spreads)
        for k, dot in enumerate(near):
            figure.annotate(literal(dot.unit), x=dot.spreads, y=y, yshift=(13, -13)[k % 2], font={"size": 12})
