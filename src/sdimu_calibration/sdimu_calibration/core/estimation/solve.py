"""From a prepared test and a model to a fit. The estimator is chosen here and nowhere else.

| estimator | chosen when |
|---|---|
| ``handheld`` | a hand turned the IMU, or the gyros' white noise in the usual rest hides the Earth's rate |
| ``second-order`` | squares of errors count: by the priors of scale and misalignment, or by the drift of the attitude |
| ``filter`` | otherwise |
| ``batch``, ``classical`` | by request |

The choice depends on the IMU file, the model, the turns, and the length of the rests and of the test.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from sdimu_calibration.core.alignment.alignment import Alignment
from sdimu_calibration.core.alignment.coarse_alignment import StartPoint, coarse_start
from sdimu_calibration.core.alignment.prepared import PreparedData, TestSetup, first_attitude, set_up, weighed_for
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.batch.batch import solve_batch
from sdimu_calibration.core.batch.classical import TABLE_FRAME, solve_classical
from sdimu_calibration.core.data.imu_class import understated_noise
from sdimu_calibration.core.effects import body_frame
from sdimu_calibration.core.effects.accelerometer_frame import (
    FRAME,
    AccelerometerFrameModel,
    accelerometer_frame_model,
    drifting,
    squares_count,
)
from sdimu_calibration.core.effects.earth_rate import NAMES as EARTH_RATE
from sdimu_calibration.core.effects.earth_rate import horizontal_earth_rate, of_any_direction
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.effects.imu_model import ImuModel, with_references
from sdimu_calibration.core.effects.references import stated_references
from sdimu_calibration.core.estimation.filter_fit import FilterFit
from sdimu_calibration.core.estimation.fit import Fit, Start
from sdimu_calibration.core.estimation.free_azimuth import azimuth_is_lost
from sdimu_calibration.core.estimation.handheld_fit import HandheldFit
from sdimu_calibration.core.estimation.handheld_solve import solve_handheld
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.estimation.noise_learning import noise_of
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.reference_fits import BatchFit, ClassicalFit
from sdimu_calibration.core.estimation.second_order_fit import SecondOrderFit
from sdimu_calibration.core.filter.filter_pass import NAV
from sdimu_calibration.core.filter.passes import Solution, attitude_about, one_pass
from sdimu_calibration.core.filter.passes import solve as solve_filter
from sdimu_calibration.core.fit_statistics import FitStatistics
from sdimu_calibration.core.progress import Progress, silent
from sdimu_calibration.core.recording import DataError, DivergedError
from sdimu_calibration.core.second_order.second_order_passes import second_order_pass, solve_second_order
from sdimu_calibration.core.specification import Model
from sdimu_calibration.core.wording import Option, Work

AUTO = "auto"
NO_FRAME = (
    "the second-order estimator needs all misalignments of the accelerometers in the model (accel_misalignment): add "
    "the effect, or choose the estimator 'filter'"
)
"""Why a model cannot be fitted in the frame of the accelerometers."""
_HIDDEN = "the noise that was learned hides the azimuth, and its passes do without one"
"""Why the second-order estimator takes the place of the one that was chosen."""


def solve(
    test: PreparedTest,
    model: Model,
    estimator: str = AUTO,
    start: Start | None = None,
    progress: Progress = silent,
    learn: bool = True,
    azimuth_free: bool = False,
) -> Fit:
    """Fit a model to a test.

    Parameters
    ----------
    model : Model
        Effects to estimate, weights of the measurements, frame of the report.
    estimator : str
        One of `ESTIMATORS`, or ``auto``.
    start : Start, optional
        Where a fit of nearly the same model ended: the estimator goes on from there.
    progress : callable
        Called with a word and the fraction done.
    learn : bool
        Learn the noise where the innovations contradict white noise.
    azimuth_free : bool
        Estimate the horizontal Earth rate in the place of the azimuth, by second-order passes. Where the noise that is
        learned hides the azimuth this is done unasked, but for a request of another estimator.
    """
    choice = choose_estimator(test, model) if estimator == AUTO else Choice(estimator, "by request")
    if choice.estimator not in ESTIMATORS:
        raise DataError(f"estimator '{estimator}': expected one of {', '.join((AUTO, *ESTIMATORS))}")
    _check(test, model, choice.estimator)
    make = _free_azimuth if azimuth_free else ESTIMATORS[choice.estimator]
    try:
        fit = replace(make(test, model, start, progress), reason=choice.reason)
    except DivergedError as error:
        noise = understated_noise(test.recording, test.imu, test.known_imus)
        stated = ", ".join(one.name for one in model.priors)
        cause = (f"; {noise}" if noise else "") + (
            f"; check the priors that the model states: {stated}" if stated else ""
        )
        assumed = f" (no site was stated: {test.assumed_site} was assumed)" if test.assumed_site else ""
        raise DivergedError(f"{error}{cause}{assumed}") from error
    if not learn:
        return fit
    found = noise_of(fit)
    asked = estimator in (AUTO, SecondOrderFit.estimator)
    if asked and found.terms and azimuth_is_lost(fit, found.terms) and _does_without_azimuth(fit):
        # Without a start: the fit is then the same whichever fit came before it.
        fit = replace(_free_azimuth(test, model, None, progress), reason=_HIDDEN)
        found = noise_of(fit)
    return found.taken_by(fit)


def _check(test: PreparedTest, model: Model, estimator: str) -> None:
    if estimator in _TAKES_PRIORS:
        return
    if model.priors:
        raise DataError(
            f"priors.{model.priors[0].name}: the estimator '{estimator}' takes priors from the IMU's file only: "
            f"leave them out of the model, or use one of {', '.join(_TAKES_PRIORS)}"
        )
    if estimator == HandheldFit.estimator and test.held_out:
        raise DataError(
            f"a run by hand has no numbered stops: state the times to leave out instead ({Option.EXCLUDE_TIMES})"
        )
    if (test.held_out or test.excluded) and estimator != HandheldFit.estimator:
        raise DataError(
            f"the estimator '{estimator}' cannot leave stops out: cut the recording ({Work.CUT}), or use one of "
            f"{', '.join(_TAKES_PRIORS)}"
        )
    site = test.site
    if site is not None and estimator != HandheldFit.estimator and stated_references(site):
        raise DataError(
            f"the estimator '{estimator}' cannot estimate the site: leave {next(iter(site.sigmas))} out of its file, "
            f"or use one of {', '.join(_TAKES_PRIORS)}"
        )


@dataclass(frozen=True)
class Choice:
    """An estimator, and why it is the one."""

    estimator: str
    """One of `ESTIMATORS`."""
    reason: str
    """Part of a sentence for people."""


def choose_estimator(test: PreparedTest, model: Model) -> Choice:
    """Choose between ``handheld``, ``second-order`` and ``filter``."""
    if test.why_handheld:
        return Choice(HandheldFit.estimator, test.why_handheld)
    setup = _setup(test, model)
    turning = body_frame.turning_names(setup.sensors.names, model.body_frame)
    stated = [one.name for one in model.priors if one.name in turning]
    if stated:
        return Choice(SecondOrderFit.estimator, f"the prior of {stated[0]} is stated in the accelerometers' frame")
    if _second_order_model(setup, float(test.recording.t[-1])) is None:
        return Choice(FilterFit.estimator, "errors are so small that their squares do not count")
    if squares_count(setup.sensors):
        return Choice(SecondOrderFit.estimator, "squares of the scale factors and misalignments of this IMU file count")
    return Choice(SecondOrderFit.estimator, "the gyros lose the attitude over the test so far that its square counts")


def extend(
    fit: Fit, effects: Sequence[Effect], warm: bool = False, progress: Progress = silent, learn: bool = True
) -> Fit:
    """Fit the same test with more effects in the model.

    Parameters
    ----------
    effects : sequence of Effect
        They come behind those of the model.
    warm : bool
        Begin where `fit` ended; else as `solve` does, which gives the same digits from any history.
    learn : bool
        As for `solve`.
    """
    model = with_effects(fit.model, effects)
    wider = solve(fit.test, model, fit.estimator, fit.start if warm else None, progress, learn, fit.azimuth_free)
    return replace(wider, reason=fit.reason)


def with_effects(model: Model, effects: Sequence[Effect | str]) -> Model:
    """Return the model with more effects.

    A model names its effects; one that no registry knows stands for itself, as `imu_model.build` takes it.
    """
    return replace(model, effects=cast("tuple[str, ...]", (*model.effects, *effects)))


def _setup(test: PreparedTest, model: Model) -> TestSetup:
    if test.site is None:
        raise DataError(
            f"no site: the navigation needs the latitude and height of the test; state the site ({Option.SITE}, in "
            "Python open(..., site=...))"
        )
    return set_up(test.site, test.imu, model, test.epoch_s(model.settle_s))


def _prepared(test: PreparedTest, model: Model, progress: Progress) -> tuple[TestSetup, PreparedData]:
    """Bring the samples to epochs; the setup then has the noise of these."""
    setup = _setup(test, model)
    progress("reduce", 0.0)
    prepared = test.data(setup)
    return weighed_for(setup, prepared), prepared


def _second_order_model(setup: TestSetup, duration: float) -> AccelerometerFrameModel | None:
    """Model in the accelerometers' frame where squares count and the model can turn; `duration` of the test (s)."""
    turns = setup.model.body_frame == FRAME
    if not (squares_count(setup.sensors) or (turns and drifting(setup.sensors, setup.imu, setup.gravity, duration))):
        return None
    return accelerometer_frame_model(setup.sensors, setup.imu)


def _filter(test: PreparedTest, model: Model, start: Start | None, progress: Progress) -> Fit:
    setup, prepared = _prepared(test, model, progress)
    inner = replace(setup, sensors=_with_references(setup.sensors, setup))
    solution = solve_filter(inner, prepared, _begin(start, inner.sensors), progress)
    return FilterFit(test, model, setup.sensors, solution.setup, prepared, solution.alignment, solution)


def _begin(start: Start | None, sensors: ImuModel) -> StartPoint | None:
    if start is None:
        return None
    return StartPoint(start.C_nb.copy(), start.coefficients_of(sensors.names) * (sensors.decay_rate == 0.0))


def _second_order(
    test: PreparedTest, model: Model, start: Start | None, progress: Progress, azimuth_free: bool = False
) -> Fit:
    frame_model = _in_accelerometer_frame(_setup(test, model), azimuth_free)
    setup, prepared = _prepared(test, model, progress)
    inner = replace(setup, sensors=frame_model.inner)
    alignment = first_attitude(prepared.epochs, prepared.phases, inner)
    begin = _begin(start, inner.sensors)
    if azimuth_free:
        alignment = alignment.with_azimuth_of((begin or coarse_start(prepared, inner, alignment)).C_nb)
    solution = solve_second_order(inner, prepared, alignment, begin, progress)
    return SecondOrderFit(test, model, setup.sensors, solution.setup, prepared, alignment, solution, frame_model)


def _free_azimuth(test: PreparedTest, model: Model, start: Start | None, progress: Progress) -> Fit:
    """Fit by second-order passes that estimate the horizontal Earth rate in the place of the azimuth."""
    return _second_order(test, model, start, progress, azimuth_free=True)


def _in_accelerometer_frame(setup: TestSetup, azimuth_free: bool) -> AccelerometerFrameModel:
    """Put the model of a setup into the accelerometers' frame, where asked with an Earth rate of any direction."""
    latitude = setup.site.latitude_rad
    along = (horizontal_earth_rate(latitude),) if azimuth_free else ()
    found = accelerometer_frame_model(setup.sensors, setup.imu, along)
    if found is None:
        raise DataError(NO_FRAME)
    inner = of_any_direction(found.inner, latitude) if azimuth_free else found.inner
    return replace(found, inner=_with_references(inner, setup))


def _with_references(sensors: ImuModel, setup: TestSetup) -> ImuModel:
    """Put behind a model what the site says of itself that it is not certain of."""
    return with_references(sensors, stated_references(setup.site))


def _does_without_azimuth(fit: Fit) -> bool:
    """Tell whether second-order passes can fit the model of a fit: it can turn, and nothing in it changes at random."""
    sensors = fit.sensors
    changing = bool(((sensors.decay_rate > 0.0) | (sensors.drive > 0.0)).any())
    return not changing and accelerometer_frame_model(sensors, fit.test.imu) is not None


@dataclass(frozen=True)
class _Reduced:
    """What both reference estimators begin with."""

    setup: TestSetup
    prepared: PreparedData
    alignment: Alignment


def _reduced(test: PreparedTest, model: Model, progress: Progress) -> _Reduced:
    setup, prepared = _prepared(test, model, progress)
    return _Reduced(setup, prepared, first_attitude(prepared.epochs, prepared.phases, setup))


def _batch(test: PreparedTest, model: Model, _start: Start | None, progress: Progress) -> Fit:
    begun = _reduced(test, model, progress)
    setup = begun.setup
    frame_model = accelerometer_frame_model(setup.sensors, setup.imu) if squares_count(setup.sensors) else None
    inner = setup if frame_model is None else replace(setup, sensors=frame_model.inner)
    found = solve_batch(begun.prepared, inner, begun.alignment, progress)
    if frame_model is None:
        frame = model.body_frame
        J = body_frame.jacobian_at(setup.sensors.names, found.coefficients, frame)
        values = body_frame.values_in_frame(setup.sensors.names, found.coefficients, frame)
        covariance = J @ found.covariance @ J.T
    else:
        frame, values = FRAME, frame_model.values(found.coefficients)
        covariance = frame_model.covariance(found.covariance, found.coefficients)
    summary = FitStatistics(found.log_evidence, found.chi2 / max(found.dof, 1), float(found.dof), float(found.steps))
    about = _navigation_about(test, model, replace(begun, setup=inner), frame_model, found.C_nb[0], found.coefficients)
    return BatchFit(test, model, setup.sensors, frame, values, covariance, summary, about)


def _classical(test: PreparedTest, model: Model, _start: Start | None, progress: Progress) -> Fit:
    begun = _reduced(test, model, progress)
    setup = begun.setup
    progress("least squares", 0.2)
    found = solve_classical(begun.prepared, setup, test.recording.table)
    summary = FitStatistics(-0.5 * found.chi2, found.chi2 / max(found.dof, 1), float(found.dof), 1.0)
    # The mount stands in the misalignments: turned into the accelerometers' frame they are those of the sensors.
    turned = body_frame.values_in_frame(setup.sensors.names, found.values, FRAME)
    about = _navigation_about(test, model, begun, None, begun.alignment.C_nb, turned)
    return ClassicalFit(test, model, setup.sensors, TABLE_FRAME, found.values, found.covariance, summary, about)


def fit_about(
    test: PreparedTest, model: Model, estimator: str, coefficients: Mapping[str, float], start: Start | None = None
) -> NavigationFit:
    """Navigate about coefficients that another estimate gives; nothing but the attitude is fitted.

    Parameters
    ----------
    estimator : str
        ``filter`` or ``second-order``.
    coefficients : mapping of str to float
        Of the estimator (SI), by name; zero where it has none.
    start : Start, optional
        Gives the attitude at the start where it is known. Of a fit without an azimuth it also gives the Earth rate in
        its place, and this fit does without one, too.
    """
    begun = _reduced(test, model, silent)
    asked = begun.setup.sensors
    here = {} if start is None else dict(zip(start.names, start.coefficients.tolist(), strict=True))
    frame_model, azimuth_free = None, here.keys() >= set(EARTH_RATE)
    if estimator == SecondOrderFit.estimator:
        frame_model = _in_accelerometer_frame(begun.setup, azimuth_free)
        begun = replace(begun, setup=replace(begun.setup, sensors=frame_model.inner))
    else:
        begun = replace(begun, setup=replace(begun.setup, sensors=_with_references(begun.setup.sensors, begun.setup)))
    C_nb = begun.alignment.C_nb if start is None else start.C_nb
    sensors = begun.setup.sensors
    known_here = dict(coefficients)
    if azimuth_free:
        begun = replace(begun, alignment=begun.alignment.with_azimuth_of(C_nb))
        known_here |= {name: here[name] for name in EARTH_RATE}
    values = np.array([known_here.get(name, 0.0) for name in sensors.names])
    fixed = replace(sensors, prior=np.zeros(len(sensors.prior)), mean=values)
    known = replace(begun, setup=replace(begun.setup, sensors=fixed))
    if start is None and frame_model is None:
        C_nb = attitude_about(known.prepared, known.setup, known.alignment, C_nb, values)
    fit = _navigation_about(test, model, known, frame_model, C_nb, values)
    return replace(fit, setup=begun.setup, sensors=asked)


def _navigation_about(
    test: PreparedTest,
    model: Model,
    begun: _Reduced,
    frame_model: AccelerometerFrameModel | None,
    C_nb: Floats,
    coefficients: Floats,
) -> NavigationFit:
    """Navigate about coefficients that stay as they are; the attitude is the filter's own."""
    setup, prepared, alignment = begun.setup, begun.prepared, begun.alignment
    if frame_model is not None:
        at = second_order_pass(prepared, setup, alignment, C_nb, coefficients)
        again = second_order_pass(prepared, setup, alignment, at.smoothed_start, coefficients)
        again.state.x[NAV : NAV + len(coefficients)] = 0.0
        done = Solution(setup, prepared, alignment, again, again, 2, converged=True)
        return SecondOrderFit(test, model, frame_model.asked, setup, prepared, alignment, done, frame_model)
    first = one_pass(prepared, setup, alignment, C_nb, coefficients, closed_loop=False)
    last = one_pass(prepared, setup, alignment, first.smoothed_start, coefficients, closed_loop=False)
    last.state.x[NAV : NAV + len(coefficients)] = 0.0
    solution = Solution(setup, prepared, alignment, first, last, 2, converged=True)
    return FilterFit(test, model, setup.sensors, setup, prepared, alignment, solution)


_TAKES_PRIORS = (FilterFit.estimator, SecondOrderFit.estimator)
"""Estimators that take priors of single coefficients, and leave measurements out."""
ESTIMATORS: Mapping[str, Callable[[PreparedTest, Model, Start | None, Progress], Fit]] = {
    FilterFit.estimator: _filter,
    SecondOrderFit.estimator: _second_order,
    HandheldFit.estimator: solve_handheld,
    BatchFit.estimator: _batch,
    ClassicalFit.estimator: _classical,
}
"""Every estimator by its name."""
