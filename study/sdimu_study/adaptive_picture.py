"""Picture of one adaptive test: how sigmas and errors fell, what was chosen, when a class was told apart."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sdimu_calibration.core.adaptive import Goals
from sdimu_calibration.core.evidence.testable import INDISTINGUISHABLE
from sdimu_calibration.report.design.palette import LIGHT, palette
from sdimu_sim.core.truth import ImuTruth
from sdimu_study.adaptive import limit_errors
from sdimu_study.adaptive_test import AdaptiveTest

_PALETTE = palette(LIGHT)
_INK, _MUTED, _LINE, _BEFORE, _AFTER = (_PALETTE[k] for k in ("ink", "muted", "line", "before", "after"))
_STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "savefig.facecolor": "white",
}
_DPI = 110


@dataclass(frozen=True)
class _Falling:
    """Largest sigma over limit of each effect, at times (min)."""

    minutes: list[float]
    effects: list[str]
    ratio: np.ndarray


def write_picture(path: Path, done: AdaptiveTest, goals: Goals, true: ImuTruth) -> None:
    """Draw a test as a PNG file.

    Parameters
    ----------
    path : Path
    done : AdaptiveTest
    goals : Goals
    true : ImuTruth
        With biases in the mean over the test.
    """
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(8.0, 7.6), layout="constrained")
        top, middle, bottom = figure.subplots(3, 1, sharex=True, height_ratios=(3.2, 1.2, 1.3))
        _sigmas(top, done, goals, true)
        _moves(middle, done)
        _apart(bottom, done)
        bottom.set_xlabel("minutes of the test")
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=_DPI, metadata={"Software": None})


def _sigmas(axes: Axes, done: AdaptiveTest, goals: Goals, true: ImuTruth) -> None:
    falling = _falling(done, goals)
    for k, effect in enumerate(falling.effects):
        axes.step(falling.minutes, falling.ratio[:, k], where="post", lw=1.2, label=effect.replace("_", " "))
    times = [look.minutes for look in done.looks]
    errors = [np.sqrt(np.mean(np.square(limit_errors(look.found.after, true, goals)))) for look in done.looks]
    axes.plot(times, errors, "o", color=_INK, ms=4, label="RMS of true error / limit")
    axes.axhline(1.0, color=_INK, lw=0.8)
    axes.set_yscale("log")
    axes.set_ylabel("largest sigma / limit")
    axes.set_title(f"What is lacking: limits '{goals.name}'")
    axes.legend(frameon=False, fontsize=8, ncols=2, loc="upper right")


def _falling(done: AdaptiveTest, goals: Goals) -> _Falling:
    names = done.looks[0].known.limited
    effects = [effect for effect in goals.limits if any(n.startswith(f"{effect}_") for n in names)]
    places = [[k for k, n in enumerate(names) if n.startswith(f"{effect}_")] for effect in effects]
    told = [(look.minutes, look.known.ratio) for look in done.looks]
    told += [(minutes + choice.minutes, choice.ratio) for minutes, choice in done.choices]
    told.sort(key=lambda one: one[0])
    ratio = np.array([[max(r[k] for k in own) for own in places] for _, r in told])
    return _Falling([minutes for minutes, _ in told], effects, ratio)


def _moves(axes: Axes, done: AdaptiveTest) -> None:
    for minutes, choice in done.choices:
        turn = choice.step.turn
        apart = choice.told > 0.5 * choice.gain
        row = 3 if turn is None else "ZYX".index(turn.axis)
        axes.barh(row, choice.minutes, 0.7, minutes, color=_AFTER if apart else _BEFORE, ec="white", lw=0.4)
        if turn is not None and choice.minutes > 0.02 * done.choices[-1][0]:
            text = f"{math.degrees(turn.angle_rad):+.0f}"
            at = minutes + 0.5 * choice.minutes
            axes.text(at, row, text, ha="center", va="center", fontsize=6, rotation=90, color="white")
    axes.set_yticks(range(4), ["Z", "Y", "X", "stay"])
    axes.set_title("What was chosen: axis, turn (deg) and the stop after it")
    for label, colour in (("for coefficients", _BEFORE), ("to tell effects apart", _AFTER)):
        axes.barh(0, 0.0, color=colour, label=label)
    axes.legend(frameon=False, fontsize=8, ncols=2, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderpad=0.0)


def _apart(axes: Axes, done: AdaptiveTest) -> None:
    found = [look for look in done.looks if look.known.named]
    axes.axhline(INDISTINGUISHABLE, color=_LINE)
    axes.text(0.0, INDISTINGUISHABLE, " told apart from here", color=_MUTED, fontsize=8, va="bottom")
    axes.set_ylim(0.0, 2.0 * INDISTINGUISHABLE)
    drawn: Sequence[tuple[float, float, str]] = [
        (look.minutes, float(gap), look.known.named[0]) for look in found if (gap := look.nearest) is not None
    ]
    if drawn:
        axes.set_ylim(0.0, 1.1 * max(2.0 * INDISTINGUISHABLE, *(gap for _, gap, _ in drawn)))
        axes.plot([m for m, _, _ in drawn], [gap for _, gap, _ in drawn], "o-", color=_AFTER, ms=4)
        axes.text(drawn[0][0], drawn[0][1], f"  {drawn[0][2]} found", color=_INK, fontsize=8, va="bottom")
    axes.set_ylabel("log Bayes factor")
    axes.set_title("What is known of effects: the one found against its nearest look-alike")
