"""What the coefficients mean in use: how far a navigation without aid drifts, as figure, table and sentence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.estimation.free_inertial import Drift, FreeInertialRun
from sdimu_calibration.core.estimation.holdout import WANTED_S
from sdimu_calibration.core.plain_text import three
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report import cost
from sdimu_calibration.report.drawing import AFTER, BEFORE, MUTED, Figure, lay_out
from sdimu_calibration.report.markup import Draw, grid, quiet, section, sentence
from sdimu_calibration.report.report_extras import ReportExtras

_NAUTICAL_MILE = 1852.0
_INK = ((MUTED, "dot"), (BEFORE, "dash"), (AFTER, "solid"))
_HOW = (
    "At its first dwell the IMU levels by its own compensated accelerometers and is given its azimuth; then it "
    "navigates freely through turns and stops, height held. The table stays in its place, so the whole drift is error. "
    "Heading is compared with a fit to the whole recording. Predicted: by the covariance of the coefficients; one "
    "segment is one draw, so up to two or three times the prediction is chance, more is not."
)
_SHORT = " There is no room for 10 minutes: the segments are as long as the recording allows."
_OF_PARTS = "Each segment was held out of the fit that navigates it."
_OF_OTHERS = (
    "Each recording is navigated with what the others tell; the biases of a power-on of its own they do not know."
)
_SKIP_S = 30.0
"""Logarithmic axes begin here: before there is nothing to see and much room for it."""
_COLUMNS = (
    "compensation",
    "segment",
    "position error (m)",
    "rate (nmi/h)",
    "predicted by the fit (m, 1 sigma)",
    "velocity error (m/s)",
    "heading drift (arcmin)",
)


def in_use(report_extras: ReportExtras, draw: Draw) -> str:
    """Return the section, or a line that says why there is none."""
    heading = "What it means in use: navigation without aid"
    if not report_extras.trials:
        return section(heading, quiet(f"Not tried: {report_extras.no_trial}.")) if report_extras.no_trial else ""
    trials = report_extras.trials
    rows = [_row(trial, drift) for trial in trials for drift in trial.drifts]
    short = min(trial.segment.length_s for trial in trials) < WANTED_S - 1.0
    return section(
        heading,
        *(sentence(trial_sentence(trial)) for trial in trials),
        sentence(f"Together: {whole.sentence}.") if (whole := cost.in_use(report_extras)) else "",
        draw(figure(trials)),
        grid(_COLUMNS, rows, {0, 1}),
        quiet(f"{_OF_OTHERS if trials[0].recording else _OF_PARTS} {_HOW}{_SHORT if short else ''}"),
    )


def trial_sentence(trial: FreeInertialRun) -> str:
    """Say a trial in one sentence."""
    stretch = trial.segment
    ends = "; ".join(
        f"{drift.name} {cost.metres(drift.distance[-1])} ({_rate(drift):.2g} nmi/h{_promise(drift)})"
        for drift in trial.drifts
    )
    at = f"{stretch.place} of {trial.recording or 'the recording'}"
    return f"Error after {stretch.length_s / 60.0:.1f} min without aid at the {at}: {ends}."


def _promise(drift: Drift) -> str:
    """Say what the fit expected; nothing for the drift of no fit."""
    last = float(drift.promised[-1])
    return f"; its fit predicted {cost.metres(last)}" if np.isfinite(last) else ""


def _row(trial: FreeInertialRun, drift: Drift) -> list[str]:
    promised = drift.promised[-1]
    stretch = trial.segment
    span = f"{stretch.begin_s / 60.0:.1f} to {(stretch.begin_s + stretch.length_s) / 60.0:.1f} min"
    return [
        drift.name,
        f"{trial.recording or stretch.place}: {span}",
        f"{drift.distance[-1]:.4g}",
        f"{_rate(drift):.2g}",
        three(promised) if np.isfinite(promised) else "",
        f"{drift.speed[-1]:.2g}",
        f"{from_si(float(drift.heading[-1]), 'arcmin'):+.2g}",
    ]


def _rate(drift: Drift) -> float:
    """Error of position over time (nautical miles an hour)."""
    return float(drift.distance[-1] / _NAUTICAL_MILE / (drift.t[-1] / 3600.0))


def figure(trials: Sequence[FreeInertialRun]) -> Figure:
    """Errors of position, velocity and heading against time, a column a stretch, a dash a compensation."""
    made = Figure(
        rows=3,
        cols=len(trials),
        titles=[t.recording or f"unseen {t.segment.place} of the recording" for t in trials],
        share_x=True,
        share_y=True,
        gap_y=0.06,
        gap_x=0.04,
    )
    for column, trial in enumerate(trials, 1):
        for (ink, dash), drift in zip(_INK, trial.ends, strict=False):
            rows = drift.t >= _SKIP_S
            heading = from_si(1.0, "arcmin") * np.abs(drift.heading)
            for row, (values, unit) in enumerate(
                ((drift.distance, "m"), (drift.speed, "m/s"), (heading, "arcmin")), start=1
            ):
                _line(made, drift.t[rows], values[rows], f"{drift.name}|{unit}", (ink, dash), (row, column))
            if np.isfinite(drift.promised).any():
                name = f"{drift.name}, predicted|m"
                _line(made, drift.t[rows], drift.promised[rows], name, (ink, dash), (1, column), 0.9)
    for row, title in enumerate(("position (m)", "velocity (m/s)", "heading (arcmin)"), start=1):
        made.y_axes(type="log", title=title, dtick=1, exponentformat="power", row=row, col=1)
        made.y_axes(type="log", dtick=1, exponentformat="power", row=row)
    made.x_axes(title="time without aid (min)", row=3)
    return lay_out(
        made,
        640,
        showlegend=True,
        margin={"l": 80, "r": 20, "t": 85, "b": 55},
        legend={"orientation": "h", "yanchor": "bottom", "y": 1.05, "x": 0},
    )


def _line(
    made: Figure, t: Floats, y: Floats, name: str, pen: tuple[str, str], at: tuple[int, int], width: float = 2.2
) -> None:
    """Draw a line: `pen` is ink and dash, `at` row and column."""
    (ink, dash), (row, column) = pen, at
    said, _, unit = name.partition("|")
    thin = width < 1.0
    made.add(
        "scatter",
        x=(t[::5] / 60.0),
        y=np.where(y > 0.0, y, np.nan)[::5],
        mode="lines",
        name=said,
        legendgroup=said,
        showlegend=row == 1 and column == 1,
        line={"color": ink, "dash": "longdashdot" if thin else dash, "width": 1.2 if thin else width},
        hovertemplate=f"%{{x:.1f}} min: %{{y:.3g}} {unit}<extra>{said}</extra>",
        row=row,
        col=column,
    )
