"""A live diagnosis as one picture: heat map, candidates, ladder. For viewers that have no such panels."""

from __future__ import annotations

import io
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from sdimu_calibration.core.diagnosis.live_diagnosis import LiveDiagnosis
from sdimu_calibration.report.data import places
from sdimu_calibration.report.design.palette import LIGHT, palette
from sdimu_calibration.report.live_text import best_ranked, model_name, size
from sdimu_calibration.report.pictures import STYLE, draw_heat_map

_PALETTE = palette(LIGHT)
_INK, _LINE, _AFTER = (_PALETTE[k] for k in ("ink", "line", "after"))
_DPI = 100
_COLOURS = 128
"""Number of colours: a third of the bytes, in a bag that has one such picture a stop."""
_MOST_BARS = 8
_TALLEST = 1.35
"""Share of the largest value that an axis shows: numbers stand beside bars."""
_WIDTH, _HEIGHT, _BAR = 8.6, 4.3, 0.2
"""Inches of the picture, of all of it but the bars, and of a bar. A layout that is worked out takes twice the time."""


def live_picture(found: LiveDiagnosis) -> bytes:
    """Draw a diagnosis that does not wait, as PNG."""
    bars = (len(best_ranked(found.ranking)[:_MOST_BARS]) or 1, len(found.ladder))
    high = _HEIGHT + _BAR * sum(bars)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(_WIDTH, high))
        grid = figure.add_gridspec(
            3, 1, height_ratios=(2.6, _BAR * bars[0], _BAR * bars[1]), left=0.27, right=0.98, top=1.0 - 0.3 / high,
            bottom=0.5 / high, hspace=0.62,
        )  # fmt: skip
        above, middle, below = (figure.add_subplot(grid[row]) for row in range(3))
        draw_heat_map(above, *places(found.where))
        above.set_title(f"Up to stop {found.stop}, {model_name(found.added)}: mean innovation over its sigma")
        above.set_xlabel("stop")
        _ranking(middle, found)
        _ladder(below, found)
        drawn, small = io.BytesIO(), io.BytesIO()
        figure.savefig(drawn, format="png", dpi=_DPI)
    with Image.open(drawn) as picture:
        picture.convert("RGB").quantize(_COLOURS, Image.Quantize.FASTOCTREE).save(small, "png")
    return small.getvalue()


def _ranking(axes: Any, found: LiveDiagnosis) -> None:
    shown = best_ranked(found.ranking)[:_MOST_BARS]
    at, scores = np.arange(len(shown)), [abs(r.z) for r in shown]
    axes.barh(at, scores, color=_LINE, edgecolor=_INK, linewidth=0.6, height=0.75)
    largest = max(scores, default=1.0)
    if np.isfinite(found.threshold):
        largest = max(largest, found.threshold)
        axes.axvline(found.threshold, color=_INK, ls="--", lw=1.2)
    for k, ranked in enumerate(shown):
        axes.text(max(scores[k], min(found.threshold, largest)), k, f" {size(ranked)}", va="center", fontsize=7)
    axes.set_yticks(at, [r.label for r in shown], fontsize=7.5)
    axes.invert_yaxis()
    axes.set_xlim(0.0, _TALLEST * largest)
    axes.set_xlabel("score |z| (sigma); dashed: what noise reaches")


def _ladder(axes: Any, found: LiveDiagnosis) -> None:
    errors = [rung.held_out if np.isfinite(rung.held_out) else 0.0 for rung in found.ladder]
    at = np.arange(len(errors))
    axes.barh(at, errors, color=_AFTER, height=0.6)
    axes.axvline(1.0, color=_INK, ls="--", lw=1.2)
    for k, rung in enumerate(found.ladder):
        told = f" {rung.held_out:.3g}" if errors[k] else " too few stops"
        axes.text(max(errors[k], 1.0), k, told, va="center", fontsize=7)
    axes.set_yticks(at, [model_name(rung.added) for rung in found.ladder], fontsize=7.5)
    axes.invert_yaxis()
    axes.set_xlim(0.0, _TALLEST * max([1.0, *errors]))
    axes.set_xlabel("error with one stop left out (sigma); dashed: 1 is right")
