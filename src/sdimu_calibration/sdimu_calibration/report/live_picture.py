"""A live diagnosis as one picture: heat map, candidates, ladder. For viewers that have no such panels."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.diagnosis.live_diagnosis import LiveDiagnosis
from sdimu_calibration.report.data import Grid, places
from sdimu_calibration.report.design.palette import DIVERGING, LIGHT, paint, palette
from sdimu_calibration.report.evidence_figures import cell
from sdimu_calibration.report.live_text import best_ranked, model_name, size
from sdimu_calibration.report.raster import CENTRE, LEFT, RIGHT, Colour, Raster, colour

_PALETTE = palette(LIGHT)
_INK, _LINE, _AFTER = (colour(_PALETTE[k]) for k in ("ink", "line", "after"))
_WHITE: Colour = (255, 255, 255)
_MOST_BARS = 8
_TALLEST = 1.35
"""Share of the largest value that an axis shows: numbers stand beside bars."""
_FULL = 8.0
"""Sigmas at which the colour of a heat map is full."""
_WHITE_FROM = 6.0
"""Sigmas from which the number in a cell is white."""
_SHADES = 16
"""Steps of the colour from nothing to full: few colours take few bytes, in a bag that has one such picture a stop."""
_WIDTH, _LEFT, _RIGHT, _TOP = 860, 232, 843, 30
"""Width of the picture, sides and top of its panels (px)."""
_ROW, _BAR, _BELOW, _GAP = 27, 20, 44, 12
"""Height of a row of the heat map and of a bar, room for the axis below a panel and between panels (px)."""
_CELL, _SMALL, _TITLE = 9, 10, 13
"""Heights of characters (px)."""
_TICKS = 7
"""Numbers that an axis has at most."""


def live_picture(found: LiveDiagnosis) -> bytes:
    """Draw a diagnosis that does not wait, as PNG."""
    grid, channels = places(found.where)
    ranked = best_ranked(found.ranking)[:_MOST_BARS]
    heights = (_ROW * len(channels), _BAR * (len(ranked) or 1), _BAR * len(found.ladder))
    drawn = Raster(_WIDTH, _TOP + sum(heights) + 3 * _BELOW + 2 * _GAP)
    title = f"Up to stop {found.stop}, {model_name(found.added)}: mean innovation over its sigma"
    drawn.text(_LEFT, _TOP / 2, title, _INK, _TITLE)
    _heat_map(drawn, _TOP, grid, channels)
    below = _TOP + heights[0] + _BELOW + _GAP
    _Bars(
        drawn,
        below,
        [abs(r.z) for r in ranked],
        [f" {size(r)}" for r in ranked],
        [r.label for r in ranked],
        found.threshold,
        _LINE,
    ).draw("score |z| (sigma); dashed: what noise reaches")
    errors = [rung.held_out if np.isfinite(rung.held_out) else 0.0 for rung in found.ladder]
    words = [f" {error:.3g}" if error else " too few stops" for error in errors]
    names = [model_name(rung.added) for rung in found.ladder]
    _Bars(drawn, below + heights[1] + _BELOW + _GAP, errors, words, names, 1.0, _AFTER).draw(
        "error with one stop left out (sigma); dashed: 1 is right"
    )
    return drawn.png()


def _shade(value: float) -> Colour:
    """Colour of a signed value (sigma), in steps; white where there is none."""
    if not np.isfinite(value):
        return _WHITE
    step = round(_SHADES * min(max(value / _FULL, -1.0), 1.0)) / _SHADES
    scale = [(at, colour(written)) for at, written in paint(DIVERGING, LIGHT)]
    at, inks = [place for place, _ in scale], np.array([ink for _, ink in scale], np.float64)
    red, green, blue = (round(float(np.interp(0.5 + 0.5 * step, at, inks[:, k]))) for k in range(3))
    return red, green, blue


def _heat_map(drawn: Raster, top: int, grid: Grid, channels: Sequence[str]) -> None:
    """Draw residual means, channel by stop: number and sign in each cell, colour besides."""
    across = np.linspace(_LEFT, _RIGHT, len(grid.stops) + 1).tolist()
    middle = [0.5 * (left + right) for left, right in itertools.pairwise(across)]
    for (row, column), value in np.ndenumerate(grid.value):
        above = top + _ROW * row
        drawn.box(across[column], above, across[column + 1], above + _ROW, _shade(float(value)))
        ink = _WHITE if abs(value) > _WHITE_FROM else _INK
        drawn.text(middle[column], above + _ROW / 2, cell(float(value)), ink, _CELL, CENTRE)
    for row, name in enumerate(channels):
        drawn.text(_LEFT - 6, top + _ROW * (row + 0.5), name.replace("_", " "), _INK, _SMALL, RIGHT)
    bottom = top + _ROW * len(channels)
    for place, stop in zip(middle, grid.stops, strict=True):
        drawn.text(place, bottom + 9, str(stop), _INK, _SMALL, CENTRE)
    drawn.text(0.5 * (_LEFT + _RIGHT), bottom + 28, "stop", _INK, _TITLE, CENTRE)


@dataclass(frozen=True)
class _Bars:
    """Bars with a name before and words behind each, over an axis from zero, and a dashed line."""

    drawn: Raster
    top: int
    """Upper edge of the first bar (px)."""
    values: Sequence[float]
    words: Sequence[str]
    names: Sequence[str]
    line: float
    """Where the dashed line is; not finite leaves it out."""
    ink: Colour
    """Of the bars."""

    def draw(self, caption: str) -> None:
        """Draw the panel, with a caption below its axis."""
        reach = self.line if math.isfinite(self.line) else 0.0
        scale = (_RIGHT - _LEFT) / (_TALLEST * (max([*self.values, reach]) or 1.0))
        bottom = self.top + _BAR * (len(self.names) or 1)
        for row, (value, name) in enumerate(zip(self.values, self.names, strict=True)):
            above = self.top + _BAR * row
            self.drawn.box(_LEFT, above + 3, _LEFT + scale * value, above + _BAR - 3, self.ink)
            self.drawn.frame(_LEFT, above + 3, _LEFT + scale * value, above + _BAR - 4, _INK)
            self.drawn.text(_LEFT - 6, above + _BAR / 2, name, _INK, _SMALL, RIGHT)
        if reach:
            self.drawn.dashed(_LEFT + scale * reach, self.top, bottom, _INK)
        for row, (value, words) in enumerate(zip(self.values, self.words, strict=True)):
            start = _LEFT + scale * max(value, reach)
            self.drawn.text(start + 3, self.top + _BAR * (row + 0.5), words, _INK, _SMALL, LEFT)
        self._axis(bottom, scale)
        self.drawn.text(0.5 * (_LEFT + _RIGHT), bottom + 30, caption, _INK, _TITLE, CENTRE)

    def _axis(self, y: int, scale: float) -> None:
        """Draw the axis, with round numbers."""
        self.drawn.box(_LEFT, y, _RIGHT, y + 1, _INK)
        self.drawn.box(_LEFT, self.top, _LEFT + 1, y, _INK)
        largest = (_RIGHT - _LEFT) / scale
        step = _round_step(largest / _TICKS)
        for k in range(int(largest / step) + 1):
            x = _LEFT + scale * step * k
            self.drawn.box(x, y, x + 1, y + 4, _INK)
            self.drawn.text(x, y + 11, f"{step * k:g}", _INK, _SMALL, CENTRE)


def _round_step(least: float) -> float:
    """Return the smallest of 1, 2 and 5 times a power of ten that is no less."""
    power = 10.0 ** math.floor(math.log10(least))
    return next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= least * (1.0 - 1e-9))
