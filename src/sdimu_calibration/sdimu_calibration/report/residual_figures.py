"""Figures of residuals: in time, against physical variables, and as what each stop and turn would need."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import CHANNELS
from sdimu_calibration.core.evidence.consistency import CHANNEL_NAMES
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report import data
from sdimu_calibration.report.drawing import AFTER, BEFORE, BEFORE_PALE, INK, MUTED, PALE, Figure, lay_out

_MOST_POINTS = 500
_BINS = 12
_GAP_MIN = 0.5
"""No line is drawn over a gap of more minutes than this: there the table turns."""


def _layers(found: data.Residuals, two: bool) -> list[tuple[Floats, str, str, str]]:
    """Residuals with the ink, mark and name of each model."""
    given = (found.before, BEFORE, "triangle-up-open", "model as given")
    return [given, (found.after, AFTER, "circle", "with what was found")] if two else [given]


def innovations(found: data.Residuals, two: bool) -> Figure:
    """Innovations of the twelve channels in time with their 3-sigma bands.

    Position and velocity are measured once after each turn; rate and force every second: there the pale line keeps the
    smallest and largest of each stretch, the marks are means over stops.

    `two`: draw both the model as given and with what was found.
    """
    titles = [name.replace("_", " ") for name in CHANNEL_NAMES]
    figure = Figure(rows=4, cols=3, titles=titles, gap_y=0.075, gap_x=0.085, share_x=True)
    minutes = found.t / 60.0
    for channel in range(12):
        place = {"row": channel // 3 + 1, "col": channel % 3 + 1}
        sigma = found.sigma[:, channel] * from_si(1.0, data.CHANNEL_UNITS[channel])
        (_bars if channel < 6 else _band)(figure, minutes, sigma, place)
        if channel >= 6:
            _raw(figure, minutes, (found.after if two else found.before)[:, channel] * sigma, place)
        for values, ink, symbol, name in _layers(found, two):
            t, y = (
                (minutes, values[:, channel] * sigma) if channel < 6 else _stop_means(found, values[:, channel] * sigma)
            )
            good = np.isfinite(y)
            figure.add(
                "scatter",
                x=t[good],
                y=y[good],
                mode="markers",
                name=name,
                legendgroup=name,
                showlegend=channel == 0,
                marker={"color": ink, "symbol": symbol, "size": 7},
                hovertemplate=f"%{{x:.1f}} min: %{{y:.3g}} {data.CHANNEL_UNITS[channel]}<extra>{name}</extra>",
                **place,
            )
        reach = _reach([found.before[:, channel], found.after[:, channel]], found.sigma[:, channel], channel < 6)
        reach *= from_si(1.0, data.CHANNEL_UNITS[channel])
        figure.y_axes(range=[-reach, reach], **place)
        # Panels of a row have one unit.
        figure.y_axes(title=data.CHANNEL_UNITS[channel], standoff=2, row=place["row"], col=1)
    figure.x_axes(title="time (min)", row=4)
    figure.y_axes(zeroline=True, zerolinecolor=MUTED, zerolinewidth=1)
    return lay_out(
        figure,
        900,
        showlegend=True,
        margin={"l": 65, "r": 20, "t": 95, "b": 55},
        legend={"orientation": "h", "yanchor": "bottom", "y": 1.045, "x": 0},
    )


def _reach(normalised: Sequence[Floats], sigma: Floats, all_of_it: bool) -> float:
    """Half the height of a panel: everything, or all but the first seconds, whose attitude is not known yet.

    One without a measurement (the velocity after a turn, where there is none) has any height.
    """
    if not np.isfinite(sigma).any():
        return 1.0
    usual = 4.0 * float(np.nanmedian(sigma))
    if all_of_it:
        return 1.15 * max(usual, *(float(np.nanmax(np.abs(y * sigma))) for y in normalised))
    far = float(np.nanquantile(np.abs(np.concatenate(normalised)), 0.995))
    return 1.15 * max(usual, 0.25 * usual * far)


def _bars(figure: Figure, minutes: Floats, sigma: Floats, place: dict[str, int]) -> None:
    good = np.isfinite(sigma)
    figure.add(
        "scatter",
        x=minutes[good],
        y=np.zeros(int(good.sum())),
        mode="markers",
        marker={"size": 1, "color": PALE},
        hoverinfo="skip",
        showlegend=False,
        error_y={"array": (3.0 * sigma[good]), "color": PALE, "thickness": 5, "width": 0},
        **place,
    )


def _band(figure: Figure, minutes: Floats, sigma: Floats, place: dict[str, int]) -> None:
    t, s = data.envelope(minutes, 3.0 * sigma, 60)
    figure.band(t, s, -s, **place)


def _raw(figure: Figure, minutes: Floats, y: Floats, place: dict[str, int]) -> None:
    t, thin = data.interrupted(*data.envelope(minutes, y, _MOST_POINTS), _GAP_MIN)
    figure.add(
        "scatter",
        x=t,
        y=thin,
        mode="lines",
        line={"color": PALE, "width": 0.7},
        hoverinfo="skip",
        showlegend=False,
        **place,
    )


def _stop_means(found: data.Residuals, y: Floats) -> tuple[Floats, Floats]:
    """Middle (min) and mean of every stop."""
    good = np.isfinite(y)
    stops, place = np.unique(found.stop[good], return_inverse=True)
    count = np.bincount(place, minlength=len(stops))
    return np.bincount(place, found.t[good]) / count / 60.0, np.bincount(place, y[good]) / count


def against_variables(
    found: data.Residuals, variables: Floats, names: Sequence[tuple[str, str]], columns: Sequence[int], two: bool
) -> Figure | None:
    """Residuals at rest against physical variables: binned means, standard errors, sigmas of one second.

    Parameters
    ----------
    variables : ndarray, shape (e, v)
    names : sequence of (str, str)
        Name and unit of each variable.
    columns : sequence of int
        Those to draw; one that does not change is left out. None when none is left.
    two : bool
        Draw both the model as given and with what was found.
    """
    rest = np.isfinite(found.before[:, 8])
    used = [k for k in columns if np.ptp(variables[rest, k]) > 0]
    if not used:
        return None
    figure = Figure(rows=6, cols=len(used), share_x=True, share_y=True, gap_y=0.02, gap_x=0.03)
    for row in range(6):
        for column, k in enumerate(used, 1):
            name, unit = names[k]
            for values, ink, symbol, of in _layers(found, two):
                x, mean, error = data.binned(variables[:, k], values[:, 6 + row], _BINS)
                figure.add(
                    "scatter",
                    x=x,
                    y=mean,
                    mode="markers",
                    name=of,
                    legendgroup=of,
                    showlegend=row == 0 and column == 1,
                    marker={"color": ink, "symbol": symbol, "size": 6},
                    error_y={"array": error, "color": ink, "thickness": 1, "width": 0},
                    hovertemplate=f"{name} = %{{x:.3g}} {unit}: %{{y:+.2f}} sigma<extra>{of}</extra>",
                    row=row + 1,
                    col=column,
                )
        figure.y_axes(title=f"{CHANNELS[row].replace('_', ' ')}<br>(sigma)", row=row + 1, col=1)
    for column, k in enumerate(used, 1):
        figure.x_axes(title=f"{names[k][0]} ({names[k][1]})", row=6, col=column)
    figure.y_axes(zeroline=True, zerolinecolor=MUTED, zerolinewidth=1, nticks=5)
    # Six panels share a window of 800 pixels: more numbers would touch those of the next panel.
    figure.x_axes(nticks=3, tickangle=0)
    return lay_out(figure, 760, showlegend=True, margin={"l": 80, "r": 20, "t": 40, "b": 60})


def free_inputs(found: data.FreeInputs, two: bool) -> Figure:
    """Constant error that every dwell (plain) and turn (hatched) would need; a star marks a score beyond three."""
    titles = [c.replace("_", " ") for c in CHANNELS]
    figure = Figure(rows=2, cols=3, titles=titles, gap_y=0.14, gap_x=0.085, share_x=True)
    middle, width = 0.5 * (found.start + found.end) / 60.0, (found.end - found.start) / 60.0
    for channel in range(6):
        place = {"row": channel // 3 + 1, "col": channel % 3 + 1}
        unit = "deg/h" if channel < 3 else "ug"
        far = np.abs(found.z[:, channel]) > data.NOTABLE
        figure.add(
            "bar",
            x=middle,
            y=found.before[:, channel],
            width=width,
            marker={
                "color": BEFORE_PALE,
                "line": {"color": BEFORE, "width": 0.5},
                "pattern": {"shape": ["/" if turn else "" for turn in found.turn], "size": 4, "fgcolor": INK},
            },
            text=["\u2217" if f else "" for f in far],
            textposition="outside",
            cliponaxis=False,
            name="model as given",
            legendgroup="before",
            showlegend=channel == 0,
            customdata=found.z[:, channel],
            hovertemplate=f"%{{x:.1f}} min: %{{y:.3g}} {unit}, z = %{{customdata:.1f}}<extra></extra>",
            **place,
        )
        if two:
            figure.add(
                "scatter",
                x=middle,
                y=found.after[:, channel],
                mode="markers",
                marker={"color": AFTER, "symbol": "circle", "size": 5},
                name="with what was found",
                legendgroup="after",
                showlegend=channel == 0,
                hovertemplate=f"%{{x:.1f}} min: %{{y:.3g}} {unit}<extra></extra>",
                **place,
            )
        figure.y_axes(title=unit, standoff=2, row=place["row"], col=1)
    figure.x_axes(title="time (min)", row=2)
    figure.y_axes(zeroline=True, zerolinecolor=MUTED, zerolinewidth=1)
    return lay_out(
        figure,
        560,
        showlegend=True,
        bargap=0,
        barmode="overlay",
        margin={"l": 60, "r": 20, "t": 95, "b": 55},
        legend={"orientation": "h", "yanchor": "bottom", "y": 1.09, "x": 0},
    )
