"""Figures of a calibration, legible in print and without colour."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.results import Calibration, History
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.design.palette import SERIES
from sdimu_calibration.report.drawing import Figure, lay_out, literal
from sdimu_calibration.report.groups import free, groups, short_name, title

_DASHES = ("solid", "dash", "dot", "dashdot", "longdash", "longdashdot")
_COLUMNS = 2
_PANEL_HEIGHT = 260
_GAP = 75
_LABEL_GAP = 0.075
"""Least distance of two labels, as a share of a panel's height."""
_MOST_POINTS = 700


def sigma_history(calibration: Calibration) -> Figure:
    """Sigma of every coefficient against time (as Fig. 3.1 of Kim, Song & Lyou), one panel an effect.

    Grey bands are rotations. A coefficient that the body frame makes zero by definition has no line.
    """
    history = calibration.history
    panels = groups(calibration.names, calibration.model)
    rows = -(-len(panels) // _COLUMNS)
    figure = Figure(
        rows=rows,
        cols=_COLUMNS,
        titles=[literal(title(effect)) for effect in panels],
        gap_y=min(_GAP / (_PANEL_HEIGHT * rows), 1.0 / max(rows - 1, 1)),
        gap_x=0.16,
    )
    kept, end = _thin(history), float(history.t[-1]) / 60.0
    for panel, (effect, indices) in enumerate(panels.items()):
        place = {"row": panel // _COLUMNS + 1, "col": panel % _COLUMNS + 1}
        unit = calibration.display_units[indices[0]]
        _label(figure, _draw(figure, calibration, effect, indices, kept, place), end, place)
        figure.y_axes(title=f"sigma ({unit})", type="log", dtick=1, exponentformat="power", **place)
        figure.x_axes(title="time (min)", standoff=2, range=[0, end], **place)
        for start, stop in rotations(history):
            figure.shade(x0=start / 60.0, x1=stop / 60.0, **place)
    return lay_out(
        figure, _PANEL_HEIGHT * rows + 60, margin={"l": 70, "r": 50, "t": 40, "b": 50}, font={"size": 12}, hovermode="x"
    )


def _draw(
    figure: Figure, calibration: Calibration, effect: str, indices: list[int], kept: Ints, place: dict[str, int]
) -> list[tuple[str, Floats, str]]:
    """Draw the lines of one panel; return label, sigmas and ink of each."""
    history, is_free = calibration.history, free(calibration)
    drawn = []
    for order, index in enumerate(indices):
        unit = calibration.display_units[index]
        sigma = history.sigma[kept, index] * from_si(1.0, unit)
        if not is_free[index]:
            continue
        sigma, ink = np.where(sigma > 0, sigma, np.nan), SERIES[order % 6]
        drawn.append((literal(short_name(calibration.names[index], effect)), sigma, ink))
        figure.add(
            "scatter",
            x=history.t[kept] / 60.0,
            y=sigma,
            mode="lines",
            name=literal(calibration.names[index]),
            line={"color": ink, "dash": _DASHES[order % 6], "width": 1.6},
            hovertemplate=f"%{{y:.3g}} {unit}",
            **place,
        )
    return drawn


def _label(figure: Figure, drawn: list[tuple[str, Floats, str]], end_min: float, place: dict[str, int]) -> None:
    """Write the names at the ends of their lines, pushed apart where lines end together."""
    if not drawn:
        return
    everything = np.log10([sigma for _, sigma, _ in drawn])
    gap = _LABEL_GAP * max(float(np.nanmax(everything) - np.nanmin(everything)), 0.5)
    for (name, _, ink), height in zip(drawn, spread(everything[:, -1], gap), strict=True):
        figure.annotate(
            name, x=end_min, y=float(height), xanchor="left", xshift=4, font={"size": 11, "color": ink}, **place
        )


def spread(heights: Floats, gap: float) -> Floats:
    """Push numbers apart until neighbours are `gap` apart, keeping their order and their mean.

    Parameters
    ----------
    heights : ndarray, shape (k,)

    Returns
    -------
    ndarray, shape (k,)
    """
    order = np.argsort(heights, kind="stable")
    # Least squares under "neighbours at least `gap` apart" is isotonic regression of heights - gap * rank: pool
    # neighbours that fall (pool adjacent violators; Ayer et al. 1955).
    pools: list[tuple[float, int]] = []
    for rank, height in enumerate(np.asarray(heights, float)[order]):
        total, count = float(height) - gap * rank, 1
        while pools and pools[-1][0] / pools[-1][1] > total / count:
            before, members = pools.pop()
            total, count = total + before, count + members
        pools.append((total, count))
    level = np.repeat([total / count for total, count in pools], [count for _, count in pools])
    result = np.empty(len(order))
    result[order] = level + gap * np.arange(len(order))
    return result


def rotations(history: History) -> list[tuple[float, float]]:
    """Spans (s) in which the table turns."""
    turning = np.concatenate([[False], ~history.dwell, [False]])
    edges = np.flatnonzero(turning[1:] != turning[:-1])
    before = np.concatenate([[0.0], history.t])
    return [(float(before[a]), float(before[b])) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _thin(history: History) -> Ints:
    """Choose the rows to draw: evenly, with the last, so that the page stays small."""
    m = len(history.t)
    return np.unique(np.linspace(0, m - 1, min(m, _MOST_POINTS)).astype(np.int64))
