"""From a prepared test and a model to a fit. The estimator is chosen here and nowhere else.

| estimator | chosen when |
|---|---|
| ``handheld`` | a hand turned the IMU, or the gyros' white noise in the usual rest hides the Earth's rate |
| ``filter`` | otherwise |
| ``batch`` | by request |

The choice depends on the noise in the IMU file, the turns, and the length of the rests: table or hand, no size of an
error. ``second-order`` is an older name of ``filter``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import cast

import numpy as np

from sdimu_calibration.core.alignment.alignment import Alignment
from sdimu_calibration.core.alignment.coarse_alignment import StartPoint, coarse_start
from sdimu_calibration.core.alignment.prepared import PreparedData, TestSetup, first_attitude, set_up, weighed_for
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.batch.batch import solve_batch
from sdimu_calibration.core.data.imu_class import understated_noise
from sdimu_calibration.core.effects.accelerometer_frame import AccelerometerFrameModel, as_asked, model_in_frame
from sdimu_calibration.core.effects.earth_rate import NAMES as EARTH_RATE
from sdimu_calibration.core.effects.earth_rate import with_any_direction
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.effects.imu_model import with_references
from sdimu_calibration.core.effects.references import stated_references
from sdimu_calibration.core.estimation.batch_fit import BatchFit
from sdimu_calibration.core.estimation.fit import Fit, Start
from sdimu_calibration.core.estimation.free_azimuth import azimuth_is_lost
from sdimu_calibration.core.estimation.handheld_fit import HandheldFit
from sdimu_calibration.core.estimation.handheld_solve import solve_handheld
from sdimu_calibration.core.estimation.navigation_fit import FILTER, NavigationFit
from sdimu_calibration.core.estimation.noise_learning import in_noise, noise_of
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.filter.filter_pass import NAV
from sdimu_calibration.core.filter.passes import one_pass
from sdimu_calibration.core.filter.solution import attitude_about
from sdimu_calibration.core.filter.solution import solve as solve_passes
from sdimu_calibration.core.progress import Progress, silent
from sdimu_calibration.core.recording import DataError, DivergedError
from sdimu_calibration.core.specification import Model
from sdimu_calibration.core.wording import Option, Work

AUTO = "auto"
_NO_NOISE = "the fit diverged: its innovations are so far from the stated noise that no noise explains them"
"""Why a fit that stands is refused: no sigma of it means anything."""
_HIDDEN = "the noise that was learned hides the azimuth, and its passes do without one"
"""Why the fit does without an azimuth, which nobody asked for."""


def solve(
    test: PreparedTest,
    model: Model,
    estimator: str = AUTO,
    start: Start | None = None,
    progress: Progress = silent,
    learn: bool = True,
    azimuth_free: bool = False,
    turns: bool = True,
) -> Fit:
    """Fit a model to a test.

    Parameters
    ----------
    model : Model
        Effects to estimate, weights of the measurements, frame of the report.
    estimator : str
        One of `ESTIMATORS`, an older name of one, or ``auto``.
    start : Start, optional
        Where a fit of nearly the same model ended: the estimator goes on from there.
    progress : callable
        Called with a word and the fraction done.
    learn : bool
        Learn the noise where the innovations contradict white noise.
    azimuth_free : bool
        Estimate the horizontal Earth rate in the place of the azimuth. Where the noise that is learned hides the
        azimuth this is done unasked.
    turns : bool
        Estimate in the accelerometers' frame where the model has all that this asks for; False: in that of its priors.
    """
    named = OLDER_NAMES.get(estimator, estimator)
    choice = choose_estimator(test, model) if named == AUTO else Choice(named, "by request")
    if choice.estimator not in ESTIMATORS:
        raise DataError(f"estimator '{estimator}': expected one of {', '.join((AUTO, *ESTIMATORS))}")
    _check(test, model, choice.estimator)
    asked = partial(_filter, azimuth_free=azimuth_free, turns=turns)
    make = asked if azimuth_free or not turns else ESTIMATORS[choice.estimator]
    try:
        fit = replace(make(test, model, start, progress), reason=choice.reason)
        if not learn:
            return fit
        terms = noise_of(fit)
    except DivergedError as error:
        raise DivergedError(f"{error}{_likely_cause(test, model)}") from error
    except np.linalg.LinAlgError as error:
        # Innovations of a hundred sigma: their squares leave the information on noise no digits.
        raise DivergedError(f"{_NO_NOISE}{_likely_cause(test, model)}") from error
    if azimuth_is_lost(fit, terms):
        # Without a start: the fit is then the same whichever fit came before it.
        fit = replace(_filter(test, model, None, progress, azimuth_free=True, turns=turns), reason=_HIDDEN)
        terms = noise_of(fit)
    return in_noise(fit, terms) if terms else fit


def _likely_cause(test: PreparedTest, model: Model) -> str:
    """Say what may be wrong where a fit diverges, as the end of a sentence."""
    noise = understated_noise(test.recording, test.imu, test.known_imus)
    stated = ", ".join(one.name for one in model.priors)
    cause = (f"; {noise}" if noise else "") + (f"; check the priors that the model states: {stated}" if stated else "")
    return cause + (f" (no site was stated: {test.assumed_site} was assumed)" if test.assumed_site else "")


def _check(test: PreparedTest, model: Model, estimator: str) -> None:
    if estimator == FILTER:
        return
    if model.priors:
        raise DataError(
            f"priors.{model.priors[0].name}: the estimator '{estimator}' takes priors from the IMU's file only: "
            f"leave them out of the model, or use '{FILTER}'"
        )
    if estimator == HandheldFit.estimator and test.held_out:
        raise DataError(
            f"a run by hand has no numbered stops: state the times to leave out instead ({Option.EXCLUDE_TIMES})"
        )
    if (test.held_out or test.excluded) and estimator != HandheldFit.estimator:
        raise DataError(
            f"the estimator '{estimator}' cannot leave stops out: cut the recording ({Work.CUT}), or use '{FILTER}'"
        )
    site = test.site
    if site is not None and estimator != HandheldFit.estimator and stated_references(site):
        raise DataError(
            f"the estimator '{estimator}' cannot estimate the site: leave {next(iter(site.sigmas))} out of its file, "
            f"or use '{FILTER}'"
        )


@dataclass(frozen=True)
class Choice:
    """An estimator, and why it is the one."""

    estimator: str
    """One of `ESTIMATORS`."""
    reason: str
    """Part of a sentence for people."""


def choose_estimator(test: PreparedTest, model: Model) -> Choice:
    """Choose between a table and a hand."""
    if test.why_handheld:
        return Choice(HandheldFit.estimator, test.why_handheld)
    _setup(test, model)
    return Choice(FILTER, "a table turned the IMU, and its gyros see the Earth's rate")


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
    # Columns of the evidence of the fit are sought in the wider one: its frame stays.
    turns = not isinstance(fit, NavigationFit) or fit.frame_model.turned
    start = fit.start if warm else None
    wider = solve(fit.test, model, fit.estimator, start, progress, learn, fit.azimuth_free, turns)
    return replace(wider, reason=fit.reason)


def with_effects(model: Model, effects: Sequence[Effect | str]) -> Model:
    """Return the model with more effects, which somebody found.

    A model names its effects; one that no registry knows stands for itself, as `imu_model.build` takes it.
    """
    more = cast("tuple[str, ...]", tuple(effects))
    return replace(model, effects=(*model.effects, *more), found=(*model.found, *more))


def _setup(test: PreparedTest, model: Model) -> TestSetup:
    if test.site is None:
        raise DataError(
            f"no site: the navigation needs the latitude and height of the test; state the site ({Option.SITE}, in "
            "Python open(..., site=...))"
        )
    return set_up(test.site, test.imu, model, test.epoch_s(model.settle_s))


def _begun(
    test: PreparedTest, model: Model, progress: Progress, azimuth_free: bool = False, turns: bool = True
) -> tuple[TestSetup, PreparedData, Alignment, AccelerometerFrameModel]:
    """Bring the samples to epochs and the model into its frame, what serves behind it; the setup has both.

    `azimuth_free` and `turns` as for `solve`.
    """
    setup = _setup(test, model)
    progress("reduce", 0.0)
    prepared = test.data(setup)
    setup = weighed_for(setup, prepared)
    frame = model.body_frame
    found = model_in_frame(setup.sensors, setup.imu, frame) if turns else as_asked(setup.sensors, frame)
    inner = with_any_direction(found.inner, setup.site.latitude_rad) if azimuth_free else found.inner
    # What the site says of itself that it is not certain of.
    inner = with_references(inner, stated_references(setup.site))
    alignment = first_attitude(prepared.epochs, prepared.phases, setup)
    return replace(setup, sensors=inner), prepared, alignment, replace(found, inner=inner)


def _filter(
    test: PreparedTest,
    model: Model,
    start: Start | None,
    progress: Progress,
    azimuth_free: bool = False,
    turns: bool = True,
) -> Fit:
    """Fit by passes; `azimuth_free` and `turns` as for `solve`."""
    setup, prepared, alignment, frame_model = _begun(test, model, progress, azimuth_free, turns)
    begin = None
    if start is not None:
        begin = StartPoint(start.C_nb.copy(), start.coefficients_of(setup.sensors.names))
    if azimuth_free:
        alignment = alignment.with_azimuth_of((begin or coarse_start(prepared, setup, alignment)).C_nb)
    found = solve_passes(setup, prepared, alignment, begin, progress)
    passes = found.last, found.passes
    return NavigationFit(
        test, model, frame_model.asked, found.setup, prepared, alignment, *passes, frame_model, found.converged
    )


def _batch(test: PreparedTest, model: Model, _start: Start | None, progress: Progress) -> Fit:
    setup, prepared, alignment, frame_model = _begun(test, model, progress)
    found = solve_batch(prepared, setup, alignment, progress)
    values = frame_model.values(found.coefficients)
    covariance = frame_model.covariance(found.covariance, found.coefficients)
    about = _navigation_about(test, model, setup, prepared, alignment, frame_model, found.C_nb[0], found.coefficients)
    return BatchFit(test, model, about.sensors, values, covariance, found.statistics, about)


def fit_about(
    test: PreparedTest, model: Model, coefficients: Mapping[str, float], start: Start | None = None
) -> NavigationFit:
    """Navigate about coefficients that another estimate gives; nothing but the attitude is fitted.

    Parameters
    ----------
    coefficients : mapping of str to float
        Of the estimator (SI), by name; zero where it has none.
    start : Start, optional
        Gives the attitude at the start where it is known. Of a fit without an azimuth it also gives the Earth rate in
        its place, and this fit does without one, too.
    """
    here = {} if start is None else dict(zip(start.names, start.coefficients.tolist(), strict=True))
    azimuth_free = here.keys() >= set(EARTH_RATE)
    setup, prepared, alignment, frame_model = _begun(test, model, silent, azimuth_free)
    sensors = setup.sensors
    C_nb = alignment.C_nb if start is None else start.C_nb
    known_here = dict(coefficients)
    if azimuth_free:
        alignment = alignment.with_azimuth_of(C_nb)
        known_here |= {name: here[name] for name in EARTH_RATE}
    values = np.array([known_here.get(name, 0.0) for name in sensors.names])
    known = replace(setup, sensors=replace(sensors, prior=np.zeros(len(sensors.prior)), mean=values))
    if start is None:
        C_nb = attitude_about(prepared, known, alignment, C_nb, values)
    fit = _navigation_about(test, model, known, prepared, alignment, frame_model, C_nb, values)
    return replace(fit, setup=setup)


def _navigation_about(
    test: PreparedTest,
    model: Model,
    setup: TestSetup,
    prepared: PreparedData,
    alignment: Alignment,
    frame_model: AccelerometerFrameModel,
    C_nb: Floats,
    coefficients: Floats,
) -> NavigationFit:
    """Navigate about coefficients that stay as they are; the attitude is the filter's own."""
    first = one_pass(prepared, setup, alignment, C_nb, coefficients)
    last = one_pass(prepared, setup, alignment, first.smoothed_start, coefficients)
    last.state.x[NAV : NAV + len(coefficients)] = 0.0
    return NavigationFit(test, model, frame_model.asked, setup, prepared, alignment, last, 2, frame_model)


ESTIMATORS: Mapping[str, Callable[[PreparedTest, Model, Start | None, Progress], Fit]] = {
    FILTER: _filter,
    HandheldFit.estimator: solve_handheld,
    BatchFit.estimator: _batch,
}
"""Every estimator by its name."""
OLDER_NAMES: Mapping[str, str] = {"second-order": FILTER}
"""Estimator by a name that files and programs may still have for it."""
