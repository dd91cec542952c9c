"""Handheld multi-position calibration: any IMU, put into many attitudes by hand, without a site.

For sensors whose noise hides the Earth's rate navigation has nothing to hold on to: no north, and a velocity that is
unknown as soon as a hand moves the IMU. What is left is enough: at rest the force is gravity, whatever the attitude,
and from rest to rest the gyros must turn it as the accelerometers see it turned. One least squares over all rests and
turns (`handheld_fit`).

What is unknown without a site is noted, not guessed: the magnitude of gravity scales all accelerometers together,
so a convention takes its place (9.80665 m/s^2, or the site's); the Earth's rate is three more unknowns whose prior is
its size. The body frame is that of the accelerometers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.data.attitudes import turned_unseen
from sdimu_calibration.core.data.stated_rests import Spans, dwells_of, stated_rests, without_spans
from sdimu_calibration.core.data.static_detection import StaticIntervals
from sdimu_calibration.core.data.trembling_rests import STEPS, relaxed, usual_scatter
from sdimu_calibration.core.effects import imu_model
from sdimu_calibration.core.effects.linear_errors import LINEAR_ERRORS
from sdimu_calibration.core.handheld.contradicted_priors import widest_priors
from sdimu_calibration.core.handheld.handheld_data import HandheldRun, reduce_run
from sdimu_calibration.core.handheld.handheld_faults import without_impossible
from sdimu_calibration.core.handheld.handheld_fit import FitPriors, HandheldSolution, fit_run
from sdimu_calibration.core.handheld.handheld_scene import first_linearisation, fit_priors
from sdimu_calibration.core.handheld.run_scatter import scatter_in_words
from sdimu_calibration.core.plain_text import counted
from sdimu_calibration.core.recording import DataError, DataFault, Recording
from sdimu_calibration.core.specification import ImuSpecification, Site
from sdimu_calibration.core.units import from_si
from sdimu_calibration.core.wording import Option, Work

_UNKNOWN = 0.5
"""Share of the prior sigma above which a coefficient is called unknown: the recording has hardly told it."""
_SEEN = 3.0
"""Ratio of the Earth's rate to its sigma: from here on it is seen."""


@dataclass(frozen=True)
class Told:
    """What the user says of a run by hand."""

    whole_sigma: float = 0.0
    """How well the IMU was put back after whole turns about the vertical (rad); 0 where none is stated."""
    rests: tuple[tuple[float, float], ...] = ()
    """Begin and end of every rest (s after the first sample); without any they are found."""
    excluded: tuple[tuple[float, float], ...] = ()
    """Spans (s) of which no rest takes anything; the turns in them count."""


@dataclass(frozen=True)
class PreparedRun:
    """A handheld recording, made ready: without impossible samples, its rests found, reduced."""

    recording: Recording
    rests: StaticIntervals
    run: HandheldRun
    notes: tuple[str, ...] = ()
    """Which rests tremble, and which were left out."""
    impossible: tuple[DataFault, ...] = ()
    """What was taken out."""


_NOTHING = Told()


def prepare_run(
    recording: Recording, imu: ImuSpecification, site: Site | None = None, told: Told = _NOTHING
) -> PreparedRun:
    """Find the rests and reduce the recording to them and the turns between."""
    recording, impossible = without_impossible(recording)
    dwells = dwells_of(recording.phase, float(recording.t[-1]))
    if told.rests or len(dwells) >= FEWEST_RESTS:
        rests = stated_rests(recording, told.rests or dwells, by_user=bool(told.rests))
        rests = without_spans(recording, rests, told.excluded)
        note = f"{len(rests)} rests as {'stated' if told.rests else 'the phase of the recording says'}"
        ready = PreparedRun(recording, rests, reduce_run(recording, rests), (note,))
    else:
        ready = _with_chosen_rests(recording, imu, site, told.excluded)
    if len(ready.rests) < FEWEST_RESTS:
        raise DataError(_too_few(recording, len(ready.rests), told))
    run = _with_whole_turns(ready.run, told.whole_sigma) if told.whole_sigma else ready.run
    return replace(ready, run=run, impossible=impossible)


def _too_few(recording: Recording, count: int, told: Told) -> str:
    rests = f"/imu/data_raw: {counted(count, 'rest')}"
    if told.rests or told.excluded:
        rests += f" with {Option.RESTS if told.rests else Option.EXCLUDE_TIMES} as stated"
    if not turned_unseen(recording):
        return (
            f"{rests}; a handheld calibration needs {FEWEST_RESTS} and more, in different attitudes: put the IMU down "
            f"for a second and more in each, or, where it trembles by more than {np.sqrt(STEPS[-1]):.0f} times its "
            f"quietest scatter, say when it rested ({Option.RESTS} 10-13,15.5-18,...)"
        )
    return (
        f"{rests} in different attitudes, and no turn between them is recorded: a handheld calibration needs "
        f"{FEWEST_RESTS} rests and more, a navigated one the turns. Record on while the IMU is turned, add attitudes, "
        f"or part the attitudes ({Work.CUT}) and calibrate them as a set: {Work.CALIBRATE} A B ..."
    )


def handheld_notes(run: HandheldRun, scene: FitPriors, found: HandheldSolution, site: Site | None) -> list[str]:
    """Say what was taken for granted, what was learned, and what stays unknown."""
    extra = found.point.extra
    out = [
        f"handheld: {len(run.t)} rests of {run.seconds.min():.1f} to {run.seconds.max():.1f} s; white noise at rest "
        f"{from_si(scene.gyro_white_noise, 'deg/h'):.3g} deg/h/sqrt(Hz), "
        f"{from_si(scene.accel_white_noise, 'ug'):.3g} ug/sqrt(Hz); beyond it "
        f"{scatter_in_words(extra.tolist())}",
        _gravity_note(scene, site),
        _earth_note(found, site),
    ]
    out += _whole_note(run)
    sigma = np.sqrt(np.diag(found.covariance))
    names = [scene.model.names[i] for i in scene.kept][: len(scene.kept) - scene.model.serving]
    known = np.sqrt(np.diag(scene.prior))[: len(names)]
    unknown = [n for n, s, q in zip(names, sigma[: len(names)], known, strict=True) if s > _UNKNOWN * q]
    if unknown:
        out.append(f"not determined by this recording: {', '.join(unknown)}")
    return out


def _whole_note(run: HandheldRun) -> list[str]:
    """Say which turns were taken for whole ones, or might be."""
    if len(run.whole):
        size = np.degrees(run.whole_sigma)
        return [f"{len(run.whole)} turns are whole ones about the vertical, as stated, to {size:.2g} deg"]
    found = _whole_turns(run)
    if not len(found):
        return []
    return [
        f"{len(found)} turns are about the vertical by nearly a multiple of 360 deg, which gravity does not show: if "
        f"the IMU was put back where it was, say how well, such as {Option.WHOLE_TURNS} '1 deg'"
    ]


def _gravity_note(scene: FitPriors, site: Site | None) -> str:
    source = "standard gravity, as no site is given" if site is None else "of the site"
    return (
        f"gravity {scene.gravity:.5f} m/s^2 ({source}); its error is a common error of all accelerometer scale factors"
    )


def _earth_note(found: HandheldSolution, site: Site | None) -> str:
    size = from_si(float(np.linalg.norm(found.point.earth)), "deg/h")
    sigma = from_si(float(np.sqrt(np.mean(found.earth_sigma**2))), "deg/h")
    if site is not None:
        return "Earth rate: vertical part of the site, north part estimated"
    seen = "seen" if size > _SEEN * sigma else "not seen"
    return f"Earth rate is estimated, as no site is given: {size:.2g} +- {sigma:.2g} deg/h, {seen} in this recording"


_SAME_SIDE = np.radians(5.0)
"""Largest angle between the forces before and after (rad): the same side lies on the desk."""
_OFF = 0.1
"""Largest share of a whole turn that the uncorrected gyros may miss it by: scale factors err by less."""
_UPRIGHT = 0.8
"""Least share of the way that is about the vertical: a desk under the IMU holds the axis, a hand does not."""


def _whole_turns(run: HandheldRun) -> Ints:
    """Find the turns that may be whole ones about the vertical: which of the k - 1, shape (w,).

    Gravity does not show a turn about itself. Who puts the IMU back where it was, against an edge, knows that it turned
    by a multiple of 360 deg, and the gyros' scale factors follow (Ferraris, Grimaldi & Parvis, "Procedure for
    effortless in-field calibration of three-axial rate gyro and accelerometers", Sensors and Materials 7, 1995).
    """
    up = run.mean[:, 3:] / np.linalg.norm(run.mean[:, 3:], axis=1, keepdims=True)
    bias = np.median(run.mean[:, :3], axis=0)
    found = []
    for i in np.flatnonzero(~run.unseen & (np.linalg.norm(np.diff(up, axis=0), axis=1) < _SAME_SIDE)):
        rows = slice(run.first[i], run.last[i])
        angle = float(((run.cycles.alpha[rows] - run.cycles.dt[rows, None] * bias) @ up[i]).sum())
        whole = 2.0 * np.pi * round(angle / (2.0 * np.pi))
        if whole and abs(angle - whole) < _OFF * 2.0 * np.pi and abs(angle) > _UPRIGHT * run.path[i]:
            found.append(int(i))
    return np.array(found, dtype=np.int64)


def _with_whole_turns(run: HandheldRun, sigma: float) -> HandheldRun:
    """Return a run whose whole turns are known to be such. `sigma`: how well the IMU was put back (rad, one sigma)."""
    found = _whole_turns(run)
    if not len(found):
        raise DataError(
            f"/imu/data_raw: {Option.WHOLE_TURNS}: no turn about the vertical comes near a multiple of 360 deg, with "
            "rests on the same side before and after it"
        )
    return replace(run, whole=found, whole_sigma=sigma)


FEWEST_RESTS = 6
"""Number of rests at least: scale and bias of three accelerometers need as many attitudes."""
_ENOUGH = 100
"""Number of quiet rests from which no others are looked for: they tell all, and a fit of hundreds takes a minute."""
_TREMBLES = 1.7
"""Ratio of the scatter of a rest to that of the quiet ones from which it trembles: its square is 3, that of quiet rests
of a whole recording is below 2."""


def _with_chosen_rests(recording: Recording, imu: ImuSpecification, site: Site | None, excluded: Spans) -> PreparedRun:
    """Find the rests with which the coefficients are known best: those that tremble too, as far as they help.

    Every step of the threshold of static detection gives a set of rests, and every set a fit with all linear errors and
    priors that hold nothing back. A rest that is none, such as a slow turn, makes the scatter that the fit learns
    larger, and with it every sigma; a good one makes them smaller. The set with the smallest sigmas in the mean is
    kept.

    `excluded`: spans of time (s) of which no rest takes anything.
    """
    sets = tuple(without_spans(recording, rests, excluded) for rests in relaxed(recording))
    runs = [PreparedRun(recording, rests, reduce_run(recording, rests)) for rests in sets]
    able = [one for one in runs if len(one.rests) >= FEWEST_RESTS] or runs[-1:]
    if len(able) == 1 or len(sets[0]) >= _ENOUGH:
        best = able[0]
    else:
        best = min(able, key=lambda one: _mean_sigma(one, imu, site))
    return replace(best, notes=_notes(sets, best))


def _mean_sigma(one: PreparedRun, imu: ImuSpecification, site: Site | None) -> float:
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


def _notes(sets: tuple[StaticIntervals, ...], best: PreparedRun) -> tuple[str, ...]:
    """Say which rests tremble, and which ones were left out."""
    ratio = _scatter(best.recording, sets[0], best.rests)
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
        worst = _scatter(best.recording, sets[0], widest)[outside].max()
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
