"""Pictures of a diagnosis as small PNG files for pages that take no HTML, such as the README.

Drawn with matplotlib, because it needs no browser; its font comes with it, so that every machine draws the same.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from PIL import Image

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.ladder import error_ladder
from sdimu_calibration.core.estimation.free_inertial import FreeInertialRun
from sdimu_calibration.core.evidence.consistency import CHANNEL_NAMES
from sdimu_calibration.report import data
from sdimu_calibration.report.architecture_figure import architecture_figure
from sdimu_calibration.report.design.palette import DIVERGING, LIGHT, paint, palette
from sdimu_calibration.report.evidence_figures import ASIDE, FAMILY_INK, MOST_BARS, bar_name, barred, cell, family_ink
from sdimu_calibration.report.may_be import MayBe, classes_of
from sdimu_calibration.report.table import with_sigma

STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "savefig.facecolor": "white",
}
_PALETTE = palette(LIGHT)
_INK, _MUTED, _LINE, _BEFORE, _AFTER = (_PALETTE[k] for k in ("ink", "muted", "line", "before", "after"))
_DPI = 110
_COLOURS = 200
_FULL = 8.0
"""Sigmas at which the colour of a heat map is full."""
_WHITE_FROM = 6.0
_FEW_BARS = 8
"""Number of bars in a small picture."""
_AXES, _BAR = 0.7, 0.22
"""Height of the axis of the candidates, and of a bar (inch)."""


def write_pictures(folder: Path, diagnosis: Diagnosis, trials: Sequence[FreeInertialRun] = ()) -> list[Path]:
    """Write heat map before and after, candidates, ladder, drift in use and the architecture as PNG files.

    `folder`: made when it is not there; files of the same names are replaced. `diagnosis`: best of a recording with
    something missing: else there is no "after", and no ladder. `trials`: free navigations; none leaves the picture of
    the drift out.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context(STYLE):
        figures = {
            "heat-map": heat_maps(diagnosis),
            "candidates": candidates(diagnosis, _FEW_BARS),
            "architecture": architecture_figure(),
        }
        if diagnosis.found.steps:
            figures["ladder"] = ladder(diagnosis)
        if trials:
            figures["in-use"] = in_use(trials)
        paths = []
        for name, figure in figures.items():
            paths.append(folder / f"{name}.png")
            _save(figure, paths[-1])
    return paths


def _save(figure: Figure, path: Path) -> None:
    """Write a PNG with few colours, which takes a third of the bytes, and neither version nor date inside."""
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=_DPI)
    with Image.open(drawn) as picture:
        picture.convert("RGB").quantize(_COLOURS, kmeans=2).save(path, optimize=True)


def heat_maps(diagnosis: Diagnosis) -> Figure:
    """Normalised residual means, channel by stop: the model as given, and with what was found."""
    grids = [("Model as given", data.where(diagnosis.consistency))]
    if len(diagnosis.found.chosen):
        names = ", ".join(c.label for c in diagnosis.chosen)
        grids.append((f"With {names}", data.stop_grid(data.residuals(diagnosis), after=True)))
    figure = Figure(figsize=(8.6, 3.0 * len(grids)), layout="constrained")
    for place, (title, grid) in enumerate(grids, 1):
        axes = figure.add_subplot(len(grids), 1, place)
        draw_heat_map(axes, grid)
        axes.set_title(f"{title}: mean innovation over its sigma{_in_white(diagnosis)}")
    axes.set_xlabel("stop")
    return figure


def _in_white(diagnosis: Diagnosis) -> str:
    """Say that figures are in white noise where noise with a memory was learned."""
    return " in white noise" if diagnosis.found.noise else ""


def draw_heat_map(axes: Any, grid: data.Grid) -> None:
    """Draw residual means, channel by stop, in axes of matplotlib: number and sign in each cell, colour besides."""
    colours = LinearSegmentedColormap.from_list("signed", paint(DIVERGING, LIGHT))
    axes.imshow(grid.value, cmap=colours, vmin=-_FULL, vmax=_FULL, aspect="auto")
    for (row, column), value in np.ndenumerate(grid.value):
        ink = "white" if abs(value) > _WHITE_FROM else _INK
        axes.text(column, row, cell(float(value)), ha="center", va="center", fontsize=6.5, color=ink)
    axes.set_yticks(range(len(CHANNEL_NAMES)), [name.replace("_", " ") for name in CHANNEL_NAMES], fontsize=7.5)
    axes.set_xticks(range(len(grid.stops)), [str(stop) for stop in grid.stops], fontsize=7.5)
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)


def candidates(diagnosis: Diagnosis, most: int = MOST_BARS) -> Figure:
    """Scores of the best candidates, and what noise reaches: the bars of the page, in its colours.

    `most`: number of bars, if fewer were found.
    """
    told, threshold = classes_of(diagnosis.found_effects, diagnosis.probabilities), diagnosis.found.threshold
    shown = barred(data.scored(diagnosis), told, most)
    found = [told.get(s.coefficient, MayBe()) for s in shown]
    figure = Figure(figsize=(8.6, _AXES + _BAR * len(shown)), layout="constrained")
    axes = figure.add_subplot()
    at = np.arange(len(shown))
    inks = [paint(family_ink(s.label), LIGHT) for s in shown]
    bars = axes.barh(at, [abs(s.z) for s in shown], color=inks, edgecolor=_INK, linewidth=0.6, height=0.75)
    for bar, s in zip(bars, shown, strict=True):
        bar.set_alpha(1.0 if s.chosen else ASIDE)
    for word, ink in FAMILY_INK.items():
        if paint(ink, LIGHT) in inks:
            axes.plot([], [], "s", color=paint(ink, LIGHT), label=f"{word}, added alone")
    if any(s.chosen for s in shown):
        left = "left with what was found"
        axes.plot([abs(s.left) for s in shown], at, "D", mfc="white", mec=_AFTER, ms=5, label=left)
    axes.axvline(threshold, color=_INK, ls="--", lw=1.2, label="what noise reaches")
    for k, (s, one) in enumerate(zip(shown, found, strict=True)):
        beside = ", ".join(word for word in (with_sigma(s.estimate, s.sigma, s.unit), one.probability) if word)
        axes.text(max(abs(s.z), threshold), k, f" {beside}", va="center", fontsize=8)
    marks = ["\N{BLACK RIGHT-POINTING TRIANGLE} " if s.chosen else "" for s in shown]
    names = [mark + bar_name(s, one) for mark, s, one in zip(marks, shown, found, strict=True)]
    axes.set_yticks(at, names, fontsize=8)
    axes.set_ylim(len(shown) - 0.5, -0.5)
    axes.set_xlim(0.0, 1.4 * max([abs(s.z) for s in shown] + [threshold]))
    axes.set_xlabel("score |z| (sigma)")
    axes.legend(loc="lower right", frameon=False, fontsize=8)
    return figure


def ladder(diagnosis: Diagnosis) -> Figure:
    """Held-out error, model by model."""
    names, errors = zip(*error_ladder(diagnosis), strict=True)
    figure = Figure(figsize=(8.6, 2.3), layout="constrained")
    axes = figure.add_subplot()
    axes.plot(errors, "o-", color=_AFTER, label="a third of the stops held out at a time")
    for x, y in enumerate(errors):
        axes.annotate(f"{y:.3f}", (x, y), (8, 5), textcoords="offset points", fontsize=8)
    axes.axhline(1.0, color=_INK, ls=":", lw=1.2, label="right")
    axes.set_xticks(range(len(names)), names)
    axes.set_xlim(-0.3, len(names) - 0.6)
    low, high = min(*errors, 1.0), max(*errors, 1.0)
    room = max(0.15 * (high - low), 0.02)
    axes.set_ylim(low - room, high + room)
    axes.set_ylabel(f"held-out error{_in_white(diagnosis)} (sigma)")
    axes.legend(frameon=False, fontsize=8)
    return figure


def in_use(trials: Sequence[FreeInertialRun]) -> Figure:
    """Position error of navigation without aid on stretches that no fit has seen."""
    figure = Figure(figsize=(8.6, 2.6), layout="constrained")
    first = None
    for place, trial in enumerate(trials, 1):
        first = axes = figure.add_subplot(1, len(trials), place, sharey=first)
        for (ink, dash), drift in zip(((_MUTED, ":"), (_BEFORE, "--"), (_AFTER, "-")), trial.ends, strict=False):
            rows = drift.t >= 30.0
            axes.semilogy(drift.t[rows] / 60.0, drift.distance[rows], dash, color=ink, lw=1.8, label=drift.name)
        axes.set_title(f"Unseen {trial.segment.place} of the recording")
        axes.set_xlabel("time without aid (min)")
        axes.set_ylabel("position error (m)" if place == 1 else "")
        axes.grid(visible=True, axis="y", color=_PALETTE["grid"], lw=0.6)
    figure.axes[0].legend(frameon=False, fontsize=8)
    return figure
