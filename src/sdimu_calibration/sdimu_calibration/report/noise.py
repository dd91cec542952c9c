"""Table, figure and page of the Allan deviation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from sdimu_calibration.core.noise import TERMS, Allan, Terms
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.design.sheet import document
from sdimu_calibration.report.drawing import MUTED, Figure, html, lay_out
from sdimu_calibration.report.markup import grid, quiet, section
from sdimu_calibration.storage.files.whole_file import write_whole

CHANNELS = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
UNITS = {
    "gyro": {
        "quantisation": "arcsec",
        "white": "deg/h/sqrt(Hz)",
        "instability": "deg/h",
        "random_walk": "deg/h/sqrt(h)",
    },
    "accel": {"quantisation": "mm/s", "white": "ug/sqrt(Hz)", "instability": "ug", "random_walk": "ug/sqrt(h)"},
}
WORDS = {
    "quantisation": "quantisation",
    "white": "white noise",
    "instability": "bias instability",
    "random_walk": "random walk of bias",
}
HEAD = ("channel", "term", "value", "sigma", "unit")
_WALKS = {"gyro": "deg/sqrt(h)", "accel": "m/s/sqrt(h)"}
_SHOWN = {"gyro": "deg/h", "accel": "ug"}
_INK = ("@x", "@y", "@z")
_DASH = ("solid", "dash", "dot")


def rows(found: Mapping[str, Terms]) -> list[tuple[str, ...]]:
    """Channel, term, value, sigma, unit, as text; a term that does not stand out is given as an upper limit."""
    out: list[tuple[str, ...]] = []
    for channel, terms in found.items():
        units = UNITS[channel.partition("_")[0]]
        for k, term in enumerate(TERMS):
            unit = units[term]
            if terms.seen[k]:
                value, sigma = (f"{from_si(float(v[k]), unit):.3g}" for v in (terms.value, terms.sigma))
            else:
                value, sigma = f"< {from_si(float(terms.upper[k]), unit):.2g}", ""
            walk = _as_walk(channel, float(terms.value[k])) if term == "white" and terms.seen[k] else ""
            out.append((channel, WORDS[term], value, sigma, f"{unit}{walk}"))
    return out


def _as_walk(channel: str, white: float) -> str:
    """Write white noise (SI) as the random walk that data sheets tell, behind its unit."""
    unit = _WALKS[channel.partition("_")[0]]
    return f" = {from_si(white, unit):.3g} {unit}"


def misfits(found: Mapping[str, Terms]) -> list[str]:
    """Say which channels the terms do not explain, and what makes such a deviation."""
    out = []
    for channel, terms in found.items():
        if not terms.misfit:
            continue
        line = f"{channel}: the terms do not explain the Allan deviation; their sigmas allow for it"
        if _peaks(terms):
            line += (
                f". At {terms.worst_s:.2g} s it is {terms.worst_ratio:.1f} times theirs, as a vibration or a base that "
                f"rocks at {_PEAK / terms.worst_s:.2g} Hz makes it: record on a base at rest"
            )
        out.append(line)
    return out


def no_rest(found: Mapping[str, Terms]) -> str:
    """Say that the IMU moved in what was taken for rest, and what the noise is worth then; empty where it stood.

    At rest a gyro shows the terms of its noise, and a peak beside them is a motion of the base.
    """
    moved = [name for name, one in found.items() if name.startswith("gyro") and one.misfit and _peaks(one)]
    if not moved:
        return ""
    return (
        f"what was taken for rest is none: the base rocks or vibrates ({', '.join(moved)}). White noise in imu.yaml "
        "is an upper limit of that of the IMU, not its noise: record on a base at rest. On such a base take "
        "the scatter of that recording (--noise estimated)"
    )


def _peaks(one: Terms) -> bool:
    return one.worst_ratio > _STANDS_OUT


_STANDS_OUT = 1.5
"""Ratio of the deviation to that of the terms from which it is a peak: slopes between the terms' make less."""
_PEAK = 0.371
"""Frequency times averaging time at the peak of the Allan deviation: of a sine (IEEE Std 952, annex C)."""


def figure(deviations: Mapping[str, Allan], found: Mapping[str, Terms]) -> Figure:
    """Allan deviation of all channels with the fits and the slopes of their terms, one panel a triad."""
    made = Figure(rows=1, cols=2, titles=("Gyros", "Accelerometers"), gap_x=0.12)
    for channel, one in deviations.items():
        triad, axis = channel.split("_")
        column, k, unit = 1 + (triad == "accel"), "xyz".index(axis), _SHOWN[triad]
        factor = from_si(1.0, unit)
        error = {"type": "data", "array": factor * one.sigma, "thickness": 1, "width": 2}
        made.add(
            "scatter",
            x=one.tau,
            y=factor * one.deviation,
            mode="markers",
            name=f"{axis}, measured",
            error_y=error,
            marker={"color": _INK[k], "symbol": ("circle", "square", "diamond")[k], "size": 6},
            col=column,
            legendgroup=axis,
            showlegend=triad == "gyro",
        )
        fine = np.geomspace(one.tau[0], one.tau[-1], 100)
        made.add(
            "scatter",
            x=fine,
            y=factor * found[channel].deviation(fine),
            mode="lines",
            name=f"{axis}, terms",
            line={"color": _INK[k], "dash": _DASH[k], "width": 1.5},
            hoverinfo="skip",
            col=column,
            legendgroup=axis,
            showlegend=triad == "gyro",
        )
    for column, triad in ((1, "gyro"), (2, "accel")):
        _slopes(made, column, [d for c, d in deviations.items() if c.startswith(triad)], from_si(1.0, _SHOWN[triad]))
    made.x_axes(type="log", title="averaging time (s)", exponentformat="power")
    for column, triad in ((1, "gyro"), (2, "accel")):
        title = f"Allan deviation ({_SHOWN[triad]})"
        made.y_axes(type="log", title=title, exponentformat="power", dtick="D2", col=column)
    return lay_out(made, 560, showlegend=True, legend={"orientation": "h", "y": -0.18, "x": 0.5, "xanchor": "center"})


def _slopes(made: Figure, column: int, deviations: Sequence[Allan], factor: float) -> None:
    """Draw the slope of each term, from one point below the measured deviations on."""
    low = float(np.log10(min(d.tau[0] for d in deviations)))
    bottom = float(np.log10(factor * min(d.deviation.min() for d in deviations)))
    for word, slope in _SLOPES:
        x, y = low + _DECADE * np.array([0.0, 1.0]), bottom + _DECADE * np.array([0.0, slope])
        made.add(
            "scatter",
            x=10.0**x,
            y=10.0**y,
            mode="lines",
            line={"color": MUTED, "width": 1},
            hoverinfo="skip",
            showlegend=False,
            col=column,
        )
        made.annotate(word, x=float(x[1]), y=float(y[1]), xanchor="left", font={"size": 10, "color": MUTED}, col=column)


_SLOPES = (("-1 quantisation", -1.0), ("-1/2 white", -0.5), ("0 instability", 0.0), ("+1/2 random walk", 0.5))
_DECADE = 1.0
"""Length of a line that shows a slope (decades): seen, and out of the way."""


def write_page(
    path: Path, deviations: Mapping[str, Allan], found: Mapping[str, Terms], title: str, words: Sequence[str]
) -> None:
    """Write the page: one file that needs no network; `words` are sentences for its head."""
    body = [
        section("Data", *(quiet(word) for word in words)),
        section(
            "Allan deviation",
            quiet("Overlapping, pooled over the stretches; bars: one sigma; lines: the terms; grey: their slopes."),
            html(figure(deviations, found), 1),
        ),
        section(
            "Terms",
            quiet(
                "Below three sigma only an upper limit is known. White noise is the angle or velocity random walk: "
                "60 deg/h/sqrt(Hz) are 1 deg/sqrt(h). The random walk of the bias is the rate random walk."
            ),
            grid(HEAD, rows(found), {0, 1, 4}),
        ),
    ]
    write_whole(path, document(title, "\n".join(body)))
