"""Figures of the evidence: where the model fails, what is missing, how the error falls, what is hard to separate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.evidence.consistency import CHANNEL_NAMES
from sdimu_calibration.report import data
from sdimu_calibration.report.design.palette import DIVERGING
from sdimu_calibration.report.drawing import AFTER, BEFORE, INK, MUTED, PALE, Figure, lay_out, literal
from sdimu_calibration.report.may_be import MayBe
from sdimu_calibration.report.table import with_sigma

_FULL = 8.0
"""Sigmas at which the colour of a heat map is full."""
_TICKS = {
    "tickvals": [-_FULL, -data.NOTABLE, 0.0, data.NOTABLE, _FULL],
    "ticktext": [
        f"\N{LESS-THAN OR EQUAL TO} \N{MINUS SIGN}{_FULL:.0f}",
        f"\N{MINUS SIGN}{data.NOTABLE:.0f}",
        "0",
        f"+{data.NOTABLE:.0f}",
        f"\N{GREATER-THAN OR EQUAL TO} +{_FULL:.0f}",
    ],
}
"""Numbers beside the colours of a heat map: from which size a cell counts, and where the colour is full."""
_MOST_NUMBERED = 40
"""Stops up to which there is room for numbers in the cells."""
MOST_BARS = 24
"""Number of bars of a ranking that a page has room for."""
_BINS = 20
_LEGEND = {"orientation": "h", "xanchor": "right", "x": 1.0, "yanchor": "bottom", "y": 1.03}
_ABOVE = "{}<br>\N{NO-BREAK SPACE}<br>\N{NO-BREAK SPACE}"
"""Title of a colour bar that does not touch its uppermost number."""
_LIMIT = {"dash": "dash", "color": INK, "width": 1.5}


def heat_map(grid: data.Grid, channels: Sequence[str] = CHANNEL_NAMES, place: str = "stop") -> Figure:
    """Normalised residual means, channel by stop or another `place`: number and sign in each cell, colour besides."""
    return deviates([str(s) for s in grid.stops], channels, grid.value, place, "channel", 440)


def heat_maps(
    grids: Sequence[data.Grid], channels: Sequence[str] = CHANNEL_NAMES, place: str = "stop", height: int = 330
) -> Figure:
    """Draw heat maps of several models with one scale of colours upon each other; a switch of the page shows one."""
    return upon_each_other([heat_map(grid, channels, place) for grid in grids], height)


def upon_each_other(maps: Sequence[Figure], height: int) -> Figure:
    """Lay maps of the same cells upon each other; a switch of the page shows one."""
    figure, *others = maps
    figure.data += [{**other.data[0], "visible": False} for other in others]
    return lay_out(figure, height, margin={"l": 95, "r": 10, "t": 12, "b": 45})


def deviates(
    columns: Sequence[str], lines: Sequence[str], value: Floats, column: str, line: str, height: int
) -> Figure:
    """Heat map of deviates: number and sign in each cell, colour besides.

    Parameters
    ----------
    columns, lines : sequence of str, lengths n and m
        What stands below the map and on its left.
    value : ndarray, shape (m, n)
        In sigma; NaN where nothing is known.
    """
    numbered = len(columns) <= _MOST_NUMBERED
    text = [[cell(v) if numbered else sign(v) for v in row] for row in value]
    figure = Figure()
    figure.add(
        "heatmap",
        x=[literal(c) for c in columns],
        y=[literal(c.replace("_", " ")) for c in lines],
        z=value,
        text=text,
        texttemplate="%{text}",
        textfont={"size": 12},
        zmin=-_FULL,
        zmax=_FULL,
        colorscale=list(DIVERGING),
        xgap=2,
        ygap=2,
        colorbar={"title": {"text": _ABOVE.format("sigma"), "side": "top"}, "thickness": 12, **_TICKS},
        hovertemplate=f"%{{y}} at {column} %{{x}}: %{{z:+.1f}} sigma<extra></extra>",
    )
    figure.x_axes(title=column, type="category", showgrid=False, ticks="")
    # A row whose name is left out for room cannot be read; one in small letters is hard to read on a screen of 4K.
    figure.y_axes(autorange="reversed", ticks="", title=line, dtick=1)
    return lay_out(figure, height, margin={"l": 120 if line == "channel" else 190, "r": 20, "t": 40, "b": 55})


def cell(value: float) -> str:
    """Write a cell: a typographic sign, and no decimals where they do not matter."""
    if not np.isfinite(value):
        return ""
    if abs(value) < 0.05:
        return "0.0"
    shown = f"{value:+.0f}" if abs(value) >= 9.95 else f"{value:+.1f}"
    return shown.replace("-", "\N{MINUS SIGN}")


def sign(value: float) -> str:
    """Write a cell where there is room for one character: the sign of what stands out."""
    if not abs(value) > data.NOTABLE:
        return ""
    return "+" if value > 0.0 else "\N{MINUS SIGN}"


def barred(entries: Sequence[data.Scored], classes: Mapping[str, MayBe], most: int) -> list[data.Scored]:
    """Choose those that have a bar, the largest score first: at most `most`, and always what was found.

    `classes`: by the coefficient of an effect that was found, what it may be: that has no bar of its own.
    """
    folded = {name for one in classes.values() for name in one.shares} - set(classes)
    rows = [s for s in data.best_variants(entries) if s.chosen or s.coefficient not in folded]
    found = {s.label for s in rows if s.chosen or s.coefficient in classes}
    others = [s.label for s in rows if s.label not in found]
    kept = found.union(others[: max(most - len(found), 0)])
    return [s for s in rows if s.label in kept]


def ranking(
    entries: Sequence[data.Scored], threshold: float, classes: Mapping[str, MayBe] | None = None, most: int = MOST_BARS
) -> Figure:
    """Bars of ``|z|``: what each candidate says alone, and what is left of it; the line is what noise reaches.

    `threshold`: score that noise reaches. `classes`: by the coefficient of an effect that was found, what it may be:
    those share bar and name of the effect, and what the mouse tells. `most`: number of bars, if fewer were found.
    """
    told = classes or {}
    shown = barred(entries, told, most)
    marks = ["\N{BLACK RIGHT-POINTING TRIANGLE} " if s.chosen else "" for s in shown]
    names = [m + literal(s.label) for m, s in zip(marks, shown, strict=True)]
    found = [told.get(s.coefficient, MayBe()) for s in shown]
    words = [beside(_size(s), one.probability) for s, one in zip(shown, found, strict=True)]
    figure = Figure()
    figure.add(
        "bar",
        y=names,
        x=[abs(s.z) for s in shown],
        orientation="h",
        name="model as given",
        marker={
            "color": [family_ink(s.label) for s in shown],
            "opacity": [1.0 if s.chosen else ASIDE for s in shown],
            "line": {"color": INK, "width": 1},
        },
        showlegend=False,
        customdata=[_in_full(s, one.shares) for s, one in zip(shown, found, strict=True)],
        hovertemplate="|z| = %{x:.1f}<br>%{customdata}<extra></extra>",
    )
    # Beside the bar, but never under the line of the noise.
    figure.add(
        "scatter",
        y=names,
        x=[max(abs(s.z), threshold) for s in shown],
        mode="text",
        customdata=[one.probability for one in found],
        text=words,
        textposition="middle right",
        cliponaxis=False,
        hoverinfo="skip",
        showlegend=False,
    )
    if any(s.chosen for s in shown):
        _left(figure, names, shown)
    _legend_of_families(figure, shown)
    figure.shape("line", x0=threshold, x1=threshold, line=_LIMIT, opacity=1.0)
    figure.annotate(
        f"noise reaches {threshold:.1f}", x=threshold, y=1, yref="y domain", xanchor="center", yanchor="bottom"
    )
    ends = [max(abs(s.z), threshold) / (1.0 - _CHARACTER * len(text)) for s, text in zip(shown, words, strict=True)]
    figure.x_axes(title="score |z| (sigma)", range=[0, max(ends, default=threshold)])
    figure.y_axes(range=[len(shown) - 0.5, -0.5], ticks="", automargin=True, title="candidate")
    # A category stays the label, by which a click takes it.
    alike = [m + literal(bar_name(s, one)) for m, s, one in zip(marks, shown, found, strict=True)]
    figure.y_axes(tickmode="array", tickvals=names, ticktext=alike)
    margin = {"l": 80, "r": 20, "t": 75, "b": 55}
    return lay_out(figure, 24 * len(shown) + 150, showlegend=True, margin=margin, legend=_LEGEND)


_CHARACTER = 0.021
"""Width of a character behind a bar as a share of the axis of candidates (1): in a window of 800 px none is cut."""
FAMILY_INK = {"gyro": "@gyro", "accelerometer": "@accel", "other": MUTED}
"""Ink of a bar by what its effect acts on."""
ASIDE = 0.45
"""Opacity of the bar of an effect that was not found (1): those that were stand out."""


def _left(figure: Figure, names: Sequence[str], shown: Sequence[data.Scored]) -> None:
    """Mark what is left of each score."""
    figure.add(
        "scatter",
        y=list(names),
        x=[abs(s.left) for s in shown],
        mode="markers",
        name="left when what was found is added",
        marker={"symbol": "diamond-open", "color": AFTER, "size": 9, "line": {"width": 2}},
        hovertemplate="%{y}<br>left: |z| = %{x:.1f}<extra></extra>",
    )


def _legend_of_families(figure: Figure, shown: Sequence[data.Scored]) -> None:
    """Say which ink a bar has by what its effect acts on."""
    for word, ink in FAMILY_INK.items():
        if any(family_ink(s.label) == ink for s in shown):
            mark = {"symbol": "square", "color": ink, "size": 10}
            figure.add("scatter", x=[None], y=[None], mode="markers", name=word, marker=mark, hoverinfo="skip")


def family_ink(label: str) -> str:
    """Ink of a bar by the label of its effect."""
    triad = label.partition("_")[0]
    return FAMILY_INK[{"gyro": "gyro", "accel": "accelerometer"}.get(triad, "other")]


def beside(*words: str) -> str:
    """Write what stands behind a bar."""
    return literal("\N{NO-BREAK SPACE}" + ", ".join(word for word in words if word))


def _size(entry: data.Scored) -> str:
    return with_sigma(entry.estimate, entry.sigma, entry.unit)


def _in_full(entry: data.Scored, shares: Mapping[str, str]) -> str:
    """Name a bar with its size, and a line each, what it may be, with the probability."""
    own, *others = (f"{literal(name)} {p}" for name, p in (shares or {entry.label: ""}).items())
    return "<br>or ".join([f"{own.strip()}<br>{_size(entry)}", *others])


def bar_name(entry: data.Scored, found: MayBe) -> str:
    """Name a bar by its effect, and what that may be instead."""
    return with_look_alikes(list(found.shares) or [entry.label])


_WIDEST = 44
"""Number of characters of a name with those of its class: longer ones leave a narrow window no room for bars."""


def with_look_alikes(names: Sequence[str]) -> str:
    """Name a bar by its effect and what that may be instead: as many as there is room for, and how many more.

    What another name begins with as the first one does is left out of it.
    """
    first, *others = names
    for count in range(len(others), 0, -1):
        more = f" and {len(others) - count} more" if count < len(others) else ""
        told = " or ".join([first, *(_short(first, other) for other in others[:count])]) + more
        if len(told) <= _WIDEST:
            return told
    return f"{first} and {len(others)} more" if others else first


def _short(first: str, other: str) -> str:
    """Return another name without the words in which it begins as the first one does."""
    words = other.split("_")
    differs = next((k for k, pair in enumerate(zip(words, first.split("_"), strict=False)) if len(set(pair)) > 1), 0)
    return f"\N{HORIZONTAL ELLIPSIS}{'_'.join(words[differs:])}" if differs else other


def explained(parts: Sequence[data.Explained]) -> Figure:
    """Misfit against what each found effect predicts, binned means; on the diagonal when it is right."""
    figure = Figure(rows=1, cols=len(parts), titles=[literal(part.label) for part in parts], gap_x=0.1)
    for column, part in enumerate(parts, 1):
        x, mean, error = data.binned(part.predicted, part.misfit, _BINS)
        ends = [float(x.min()), float(x.max())] if len(x) else [0.0, 0.0]
        figure.add(
            "scatter",
            x=ends,
            y=ends,
            mode="lines",
            line={"color": INK, "dash": "dash", "width": 1},
            hoverinfo="skip",
            col=column,
        )
        figure.add(
            "scatter",
            x=x,
            y=mean,
            mode="markers",
            error_y={"array": error, "color": BEFORE, "thickness": 1.5},
            marker={"color": BEFORE, "size": 7},
            hovertemplate="predicted %{x:.2f}, found %{y:.2f} sigma<extra></extra>",
            col=column,
        )
        figure.x_axes(title="effect predicts (sigma)", col=column)
    figure.y_axes(title="misfit found (sigma)", col=1)
    return lay_out(figure, 360)


def correlation(names: Sequence[str], C: Floats) -> Figure:
    """Correlation of the coefficients; cells beyond one half carry their number."""
    shown = [literal(name.replace("_", " ")) for name in names]
    text = [
        [f"{v:+.1f}".replace("-", "\N{MINUS SIGN}") if abs(v) > 0.5 and i != j else "" for j, v in enumerate(row)]
        for i, row in enumerate(C)
    ]
    figure = Figure()
    figure.add(
        "heatmap",
        x=shown,
        y=shown,
        z=C,
        text=text,
        texttemplate="%{text}",
        textfont={"size": 11},
        zmin=-1,
        zmax=1,
        colorscale=list(DIVERGING),
        xgap=1,
        ygap=1,
        colorbar={"title": {"text": _ABOVE.format("correlation"), "side": "top"}, "thickness": 12},
        hovertemplate="%{y} \u00b7 %{x}: %{z:.2f}<extra></extra>",
    )
    figure.x_axes(tickangle=-60)
    figure.y_axes(autorange="reversed")
    for update in (figure.x_axes, figure.y_axes):
        update(ticks="", automargin=True, showline=False, tickfont={"size": 11}, title="coefficient")
    figure.shape("line", y0=-0.5, y1=-0.5, line={"color": PALE, "width": 1})
    return lay_out(figure, 20 * len(shown) + 260, margin={"l": 60, "r": 20, "t": 20, "b": 60})
