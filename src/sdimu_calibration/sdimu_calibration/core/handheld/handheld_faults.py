"""Faults in the data of a handheld run: what is wrong with the data and no physics of the sensor.

The least squares learns the scatter of its equations, so most faults only widen its sigmas. A hand knocks and jerks,
and a cheap sensor repeats its numbers at rest: `sample_screening`, which is made for a table, would report spikes and a
stuck axis. Only what no hand can do is looked for here.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.data.gaps import open_angle, step_fault, told_together
from sdimu_calibration.core.data.sample_screening import CHANNELS, taken_away
from sdimu_calibration.core.handheld.handheld_data import HandheldRun
from sdimu_calibration.core.handheld.handheld_fit import HandheldSolution
from sdimu_calibration.core.handheld.range_end import at_range_end
from sdimu_calibration.core.handheld.run_scatter import FORCE, TURN
from sdimu_calibration.core.note import Note, Topic
from sdimu_calibration.core.plain_text import counted
from sdimu_calibration.core.recording import DataFault, Recording
from sdimu_calibration.core.results import NOT_TRUSTED
from sdimu_calibration.core.units import STANDARD_GRAVITY, from_si
from sdimu_calibration.core.wording import Option

_BEYOND = 10.0
"""Ratio to the 99th percentile from which a rate is impossible: a hand accelerates for longer than a sample."""
_TURN_MISFIT = 0.01
"""Largest misfit of turns, a share of their angle: the Xsens recording has 0.0004."""
_FORCE_MISFIT = 0.01 * STANDARD_GRAVITY
"""Largest misfit of the specific force at rest (m/s^2): the Xsens recording has a hundredth of it."""


def without_impossible(recording: Recording) -> tuple[Recording, tuple[DataFault, ...]]:
    """Take away samples of a rate far beyond all others; they count as missing.

    Returns
    -------
    recording : Recording
        The same object when nothing is wrong.
    faults : tuple of DataFault
    """
    rate = np.max(np.abs(recording.omega_ib_b - np.median(recording.omega_ib_b, axis=0)), axis=1)
    bad = rate > _BEYOND * float(np.quantile(rate, 0.99))
    if not bad.any():
        return recording, ()
    t = recording.t[bad]
    text = (
        f"the gyros jump to {_BEYOND:.0f} times the fastest turns and more in {counted(len(t), 'sample')} "
        f"({t[0]:.1f} to {t[-1]:.1f} s), taken as missing"
    )
    return taken_away(recording, bad), (DataFault("spike", text, len(t), float(t[0]), float(t[-1])),)


def data_faults(recording: Recording, run: HandheldRun, found: HandheldSolution) -> tuple[DataFault, ...]:
    """List missing samples, steps of the clock, readings at the end of the range, misfits that no sensor explains."""
    return (*_missing(run), *_stepped(recording, run), *_clipped(recording, run), *_misfit(found))


def _stepped(recording: Recording, run: HandheldRun) -> tuple[DataFault, ...]:
    out = []
    for step in recording.clock_steps:
        cycle, _ = open_angle(step, run.cycles)
        turn = (run.first <= cycle) & (cycle < run.last)
        told = step_fault(step, not np.any(turn))
        unseen = bool(np.any(run.unseen & turn))
        out.append(replace(told, text=f"{told.text}; the turn says nothing") if unseen else told)
    return told_together(out)


def _missing(run: HandheldRun) -> list[DataFault]:
    at = np.flatnonzero(run.cycles.lost)
    if not len(at):
        return []
    lost, t = int(run.cycles.lost.sum()), run.cycles.t[at]
    text = f"{counted(lost, 'sample is', 'samples are')} missing by their stamps ({t[0]:.1f} to {t[-1]:.1f} s), bridged"
    unseen = int(run.unseen.sum())
    if unseen:
        text += f"; {unseen} of {len(run.unseen)} turns have gaps in which anything may have happened, and say nothing"
    return [DataFault("gap", text, lost, float(t[0]), float(t[-1]))]


def _clipped(recording: Recording, run: HandheldRun) -> tuple[DataFault, ...]:
    """Find channels that stand at the end of their range; grave where such readings are in the mean of a rest."""
    clipped = at_range_end(recording)
    at_rest = _at_rest(recording.t, run)
    return tuple(
        _clip(name, recording.t[bad], at_rest[bad], gyro=channel < 3)
        for channel, (name, bad) in enumerate(zip(CHANNELS, clipped.T, strict=True))
        if bad.any()
    )


def _clip(name: str, t: Floats, at_rest: Bools, gyro: bool) -> DataFault:
    """Say that a channel stands at the end of its range at times `t` (s), of which some are `at_rest`."""
    text = f"{name} is at the end of its range in {counted(len(t), 'sample')} ({_span(t)})"
    if at_rest.any():
        where = f"{np.floor(t[at_rest][0] * 10.0) / 10.0:.1f}-{np.ceil(t[at_rest][-1] * 10.0) / 10.0:.1f}"
        told = (
            f"{text}, at rest: the mean of that rest is {NOT_TRUSTED}; leave that time out ({Option.EXCLUDE_TIMES} "
            f"{where}), or give the sensor a wider range and record again"
        )
        return DataFault("saturated", Note(told, Topic.NOT_TRUSTED), len(t), float(t[0]), float(t[-1]), grave=True)
    if gyro:
        text += ": the turns there say nothing; turn the IMU more slowly, or give the sensor a wider range"
    return DataFault("saturated", text, len(t), float(t[0]), float(t[-1]))


def _span(t: Floats) -> str:
    first, last = f"{t[0]:.1f}", f"{t[-1]:.1f}"
    return f"{first} s" if first == last else f"{first} to {last} s"


def _at_rest(t: Floats, run: HandheldRun) -> Bools:
    """Say which of some times (s), shape (n,), are in the mean of a rest."""
    begin = run.t - 0.5 * run.seconds
    rest = np.searchsorted(begin, t, side="right") - 1
    return np.asarray((rest >= 0) & (t <= begin[rest] + run.seconds[rest]))


def _misfit(found: HandheldSolution) -> list[DataFault]:
    """Warn when what the model leaves over is no noise of any sensor."""
    because = (
        f"far more than any sensor: the estimate is {NOT_TRUSTED}; look for samples that are clipped, stuck or "
        "missing, an axis without its sign, an IMU switched off in between"
    )
    out = []
    extra = found.point.extra
    if extra[TURN] > _TURN_MISFIT:
        text = f"turns have errors of {100.0 * extra[TURN]:.2g} % of their angle, {because}"
        out.append(DataFault("misfit", Note(text, Topic.NOT_TRUSTED), grave=True))
    if extra[FORCE] > _FORCE_MISFIT:
        text = f"force at rest has errors of {from_si(float(extra[FORCE]), 'mg'):.3g} mg, {because}"
        out.append(DataFault("misfit", Note(text, Topic.NOT_TRUSTED), grave=True))
    return out
