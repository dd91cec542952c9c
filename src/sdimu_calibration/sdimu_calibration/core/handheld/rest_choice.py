"""Which rests of a run by hand count: those that tremble too, as far as the coefficients are known better with them.

Every step of the threshold of static detection gives a set of rests, and every set a fit with all linear errors and
priors that hold nothing back. A rest that is none, such as a slow turn, makes the scatter that the fit learns larger,
and with it every sigma; a good one makes them smaller. The set with the smallest sigmas in the mean is kept.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.data.stated_rests import Spans, without_spans
from sdimu_calibration.core.data.static_detection import StaticIntervals
from sdimu_calibration.core.data.trembling_rests import relaxed, usual_scatter
from sdimu_calibration.core.effects import imu_model
from sdimu_calibration.core.effects.linear_errors import LINEAR_ERRORS
from sdimu_calibration.core.handheld.contradicted_priors import widest_priors
from sdimu_calibration.core.handheld.handheld_data import HandheldRun, reduce_run
from sdimu_calibration.core.handheld.handheld_fit import fit_run
from sdimu_calibration.core.handheld.handheld_scene import first_linearisation, fit_priors
from sdimu_calibration.core.plain_text import counted
from sdimu_calibration.core.recording import DataError, Recording
from sdimu_calibration.core.specification import ImuSpecification, Site
from sdimu_calibration.core.wording import Option

FEWEST_RESTS = 6
"""Number of rests at least: scale and bias of three accelerometers need as many attitudes."""
_ENOUGH = 100
"""Number of quiet rests from which no others are looked for: they tell all, and a fit of hundreds takes a minute."""
_TREMBLES = 1.7
"""Ratio of the scatter of a rest to that of the quiet ones from which it trembles: its square is 3, that of quiet rests
of a whole recording is below 2."""


@dataclass(frozen=True)
class ChosenRests:
    """The rests that count, and what is to be said of them."""

    rests: StaticIntervals
    run: HandheldRun
    notes: tuple[str, ...] = ()
    """Rests that tremble, and rests that were left out."""


def choose_rests(recording: Recording, imu: ImuSpecification, site: Site | None, excluded: Spans = ()) -> ChosenRests:
    """Find the rests with which the coefficients are known best.

    `excluded`: spans of time (s) of which no rest takes anything.
    """
    sets = tuple(without_spans(recording, rests, excluded) for rests in relaxed(recording))
    runs = [ChosenRests(rests, reduce_run(recording, rests)) for rests in sets]
    able = [one for one in runs if len(one.rests) >= FEWEST_RESTS] or runs[-1:]
    if len(able) == 1 or len(sets[0]) >= _ENOUGH:
        best = able[0]
    else:
        best = min(able, key=lambda one: _mean_sigma(one, imu, site))
    return ChosenRests(best.rests, best.run, _notes(recording, sets, best))


def _mean_sigma(one: ChosenRests, imu: ImuSpecification, site: Site | None) -> float:
    """Mean logarithm of the sigmas of all coefficients; infinite where the rests fit no IMU."""
    sensors = imu_model.build(LINEAR_ERRORS, imu)
    wide = widest_priors(imu, sensors)
    sensors = imu_model.build(LINEAR_ERRORS, wide)
    priors = fit_priors(sensors, wide, site, one.rests)
    try:
        found = fit_run(one.run, priors, first_linearisation(one.run, sensors, priors.gravity))
    except DataError:
        return np.inf
    return float(0.5 * np.mean(np.log(np.diag(found.covariance))))


def _notes(recording: Recording, sets: tuple[StaticIntervals, ...], best: ChosenRests) -> tuple[str, ...]:
    """Say which rests tremble, and which ones were left out."""
    ratio = _scatter(recording, sets[0], best.rests)
    trembling = ratio[ratio > _TREMBLES]
    notes = []
    if len(trembling):
        notes.append(
            f"{counted(len(trembling), 'rest trembles', 'rests tremble')}, by up to {trembling.max():.2g} times the "
            "scatter of the quiet ones, and weigh by their own scatter"
        )
    widest = sets[-1]
    outside = [
        not np.any((best.rests.first < b) & (a < best.rests.last))
        for a, b in zip(widest.first, widest.last, strict=True)
    ]
    if any(outside):
        worst = _scatter(recording, sets[0], widest)[outside].max()
        notes.append(
            f"{counted(sum(outside), 'moment', 'moments')} at rest left out, with up to {worst:.2g} times the scatter "
            f"of the quiet rests: with them the coefficients are known less well; {Option.RESTS} states the rests"
        )
    return tuple(notes)


def _scatter(recording: Recording, quiet: StaticIntervals, rests: StaticIntervals) -> Floats:
    """Scatter of each rest over that of the quieter half of the quiet ones, the larger of both triads, shape (k,)."""
    out = []
    for values in (recording.omega_ib_b, recording.f_ib_b):
        usual, own = (usual_scatter(values, of, recording.interval_s) for of in (quiet, rests))
        out.append(np.sqrt(own / max(float(np.quantile(usual, 0.25)), np.finfo(float).tiny)))
    return np.asarray(np.max(out, axis=0))
