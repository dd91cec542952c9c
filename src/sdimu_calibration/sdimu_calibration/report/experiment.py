"""What an experimenter looks for: the raw data with their stops, the attitude at each stop, what the table did."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from importlib.resources import files

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.data.blocks import let_go
from sdimu_calibration.core.effects.effect import AXES, CHANNELS
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.recording import Recording, TableLog
from sdimu_calibration.core.units import STANDARD_GRAVITY
from sdimu_calibration.report.design.library import as_script
from sdimu_calibration.report.drawing import Figure, lay_out, literal
from sdimu_calibration.report.markup import Draw, quiet, section

_BLOCKS = 500
"""Number of stretches of the raw data, of each of which the smallest and largest value are drawn."""
_MOST_ANGLES = 2000
"""Number of points of a curve of an axis of the table."""
ATTITUDE_SCRIPT = (files("sdimu_calibration.report.design") / "attitude.js").read_text(encoding="utf-8")


def data_section(fit: Fit, draw: Draw) -> str:
    """Return raw data, attitudes and the sequence of the table."""
    recording = fit.test.recording
    moved = [draw(sequence(recording.table, fit))] if recording.table is not None else []
    return section(
        "Data: what was recorded",
        quiet("Smallest and largest value of every stretch of the raw samples; grey: stops that are measured."),
        draw(raw_data(recording, fit)),
        attitude_view(fit),
        *moved,
    )


def envelope(t: Floats, y: Floats, blocks: int = _BLOCKS) -> tuple[Floats, Floats, Floats]:
    """Middle, smallest and largest value of stretches of equal numbers of samples.

    Parameters
    ----------
    t : ndarray, shape (n,)
        s.
    y : ndarray, shape (n, c)
    blocks : int
        At most.

    Returns
    -------
    middle : ndarray, shape (b,)
        s.
    low, high : ndarray, shape (b, c)
        In the unit of `y`.
    """
    first = np.unique(np.linspace(0, len(t), min(blocks, len(t)), endpoint=False).astype(np.int64))
    last = np.append(first[1:], len(t)) - 1
    low, high = np.empty((len(first), y.shape[1])), np.empty((len(first), y.shape[1]))
    for k, (a, b) in enumerate(zip(first.tolist(), last.tolist(), strict=True)):
        low[k], high[k] = y[a : b + 1].min(axis=0), y[a : b + 1].max(axis=0)
        let_go(y)
    return 0.5 * (t[first] + t[last]), low, high


def raw_data(recording: Recording, fit: Fit) -> Figure:
    """Envelope of the six sensors in time with the stops shaded."""
    figure = Figure(
        rows=2, cols=3, titles=[name.replace("_", " ") for name in CHANNELS], gap_x=0.07, gap_y=0.14, share_x=True
    )
    t, *rate = envelope(recording.t, recording.omega_ib_b)
    _, *force = envelope(recording.t, recording.f_ib_b)
    low, high = (np.hstack([np.degrees(w), f / STANDARD_GRAVITY]) for w, f in zip(rate, force, strict=True))
    minutes = t / 60.0
    for channel in range(6):
        place = {"row": channel // 3 + 1, "col": channel % 3 + 1}
        unit, ink = ("deg/s", "g")[channel // 3], f"@{AXES[channel % 3]}"
        figure.add(
            "scatter",
            x=np.concatenate([minutes, minutes[::-1]]),
            y=np.concatenate([high[:, channel], low[::-1, channel]]),
            mode="lines",
            fill="toself",
            fillcolor=ink,
            line={"color": ink, "width": 1},
            hoveron="points",
            hovertemplate=f"%{{x:.2f}} min: %{{y:.4g}} {unit}<extra></extra>",
            **place,
        )
        for _, start, end in fit.timetable.stops:
            figure.shade(x0=start / 60.0, x1=end / 60.0, **place)
        figure.y_axes(showgrid=False, **place)
        figure.y_axes(title=unit, standoff=4, row=place["row"], col=1)
    figure.x_axes(title="time (min)", row=2)
    figure.x_axes(showgrid=False)
    return lay_out(figure, 430, margin={"l": 65, "r": 15, "t": 40, "b": 50})


def sequence(table: TableLog, fit: Fit) -> Figure:
    """Angles of the axes of the table in time, as its encoders read them; shown, never used."""
    figure = Figure()
    rows = np.unique(np.linspace(0, len(table.t) - 1, min(len(table.t), _MOST_ANGLES)).astype(np.int64))
    for k, name in enumerate(table.names):
        figure.add(
            "scatter",
            x=table.t[rows] / 60.0,
            y=np.degrees(table.angle[rows, k]),
            mode="lines",
            name=literal(name.replace("_", " ")),
            line={"color": f"@{AXES[k % 3]}", "dash": ("solid", "dash", "dot")[k % 3]},
            hovertemplate="%{x:.1f} min: %{y:.2f} deg<extra>" + escape(name) + "</extra>",
        )
    for _, start, end in fit.timetable.stops:
        figure.shade(x0=start / 60.0, x1=end / 60.0)
    figure.x_axes(title="time (min)", showgrid=False)
    figure.y_axes(title="angle of the table's axes (deg)")
    return lay_out(figure, 300, showlegend=True, margin={"l": 65, "r": 15, "t": 40, "b": 50})


@dataclass(frozen=True)
class Attitudes:
    """Attitude at each stop: `words` say which, `C_nb` (s, 3, 3) is b to n; `latitude` (rad) is None by hand."""

    words: tuple[str, ...]
    C_nb: Floats
    latitude: float | None


def attitudes(fit: Fit) -> Attitudes:
    """Attitude of the IMU at the end of every stop, as the fit has it."""
    if isinstance(fit, NavigationFit):
        used, stop = fit.prepared.kind > 0, fit.prepared.phases.stop
        last = np.array([np.flatnonzero(used & (stop == one))[-1] for one in np.unique(stop[used])])
        words = tuple(f"stop {stop[row]}, {fit.prepared.epochs.end[row] / 60.0:.1f} min" for row in last)
        return Attitudes(words, fit.last.output.C_nb[last], fit.setup.site.latitude_rad)
    C = np.reshape(fit.start.C_nb, (-1, 3, 3))
    return Attitudes(tuple(f"rest {k}" for k in range(len(C))), C, None)


def attitude_view(fit: Fit) -> str:
    """Return the IMU in space at a stop of one's choice; heading is arbitrary by hand."""
    found = attitudes(fit)
    content = as_script(
        {
            "C": np.round(found.C_nb.reshape(-1, 9), 4).tolist(),
            "words": found.words,
            "latitude": found.latitude,
            "arbitrary": found.latitude is None,
        }
    )
    told = "x, y, z: axes of the IMU; g: gravity; " + (
        "\N{GREEK CAPITAL LETTER OMEGA}: the Earth's rate; N, E: horizon."
        if found.latitude is not None
        else "the heading is arbitrary."
    )
    head = (
        '<defs><marker id="head" viewBox="0 0 8 8" refX="6" refY="4" markerWidth="5" markerHeight="5" orient="auto">'
        '<path d="M0 0L8 4L0 8z" fill="context-stroke"/></marker></defs>'
    )
    return (
        f'<div class="attitude"><svg viewBox="0 0 200 200" role="img" aria-label="attitude of the IMU">{head}</svg>'
        f'<div><h3>The IMU at a stop</h3><p><label>Stop <input type="range" min="0" max="{len(found.words) - 1}" '
        f'value="0"></label> <output></output></p>{quiet(told + " Drag the picture to look from elsewhere.")}</div>'
        f'<script type="application/json">{content}</script></div>'
    )
