"""Fits of the workbench, in parts: the numbers, which are quick, then the candidates, then one of them looked at.

Samples are prepared once a recording, and each fit starts where the fit with one effect less ended. Kept is only what a
page shows: the matrices of a fit and of its candidates, some 300 MB, stay for the last one alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from threading import RLock
from typing import Any

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.addition import Addition, addition, objections
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis, climb
from sdimu_calibration.core.diagnosis.found import looked_at
from sdimu_calibration.core.diagnosis.free_input_test import FreeInputTest
from sdimu_calibration.core.diagnosis.problem import Problem
from sdimu_calibration.core.diagnosis.summary import DiagnosisSummary, summarise
from sdimu_calibration.core.diagnosis.survey import survey
from sdimu_calibration.core.effects import imu_model
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.estimation.fit import Fit, Start
from sdimu_calibration.core.estimation.free_inertial import FOUND
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.estimation.outcome import outcome
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve, with_effects
from sdimu_calibration.core.measurement_kind import SKIP
from sdimu_calibration.core.note import without_advice
from sdimu_calibration.core.posterior.told import Probabilities
from sdimu_calibration.core.posterior.unknown import UnknownFunction
from sdimu_calibration.core.progress import silent
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import Calibration, no_history
from sdimu_calibration.core.specification import Model
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.report import data
from sdimu_calibration.report.cost import InUse, Off, in_use, wrong_without
from sdimu_calibration.report.may_be import MayBe, classes_of
from sdimu_calibration.report.report_extras import ReportExtras
from sdimu_calibration.report.unknown_section import unknown_of
from sdimu_calibration.report.workbench.axes import axes
from sdimu_calibration.report.workbench.own_effect import added_effects, named, stated_priors
from sdimu_calibration.report.workbench.setting import Setting

Tell = Callable[[str, float], None]
_MOST_KEPT = 200
"""Fits that are kept: each holds some 3 MB."""


@dataclass(frozen=True)
class Fitted:
    """The numbers of one fit."""

    calibration: Calibration
    """Without the history of its last pass."""
    prior: Floats
    mean: Floats
    """`prior`, `mean`: sigma and mean of each coefficient's prior (SI), shape (p,)."""
    stated: Floats
    """One-sigma (SI) that the IMU's file, or physics, gives each coefficient, shape (p,)."""
    grid: data.Grid
    """Normalised means, channel by stop."""
    residuals: data.Residuals
    begin: Floats
    """Start of each epoch (s), shape (e,)."""
    axes: Mapping[str, Floats]
    """What they can be drawn against, shape (e,)."""
    left_out: Floats
    """Shape (e, 12). Prediction errors (sigma) of what the fit has not seen; NaN elsewhere."""
    held_out: float
    """Leave-one-stop-out RMS over the stops of the fit (sigma)."""
    at_held: float | None
    """RMS of `left_out`."""
    start: Start
    """Where a fit with one effect more begins."""


@dataclass(frozen=True)
class Missing:
    """What a fit does not explain."""

    entries: tuple[data.Scored, ...]
    """All candidates, largest score first."""
    threshold: float
    """Size of the score that pure noise reaches."""
    adequate: bool
    sentence: str
    left: FreeInputTest
    held_out: float | None
    """Error at stops or rests held out (sigma), as `sdimu calibrate` has it."""
    probabilities: Probabilities | None = None
    """Of nothing, and of each family of effects, as `sdimu diagnose` has them."""
    unknown: tuple[UnknownFunction, ...] = ()
    """Errors that no effect explains, by what they follow."""
    mended: bool = False
    """Something is missing, and effects explain the recording: those that were found, or some of a class."""
    worst: Off | None = None
    """The coefficient that is furthest off, in its sigmas, without what was found; None where nothing was, or none is.
    """
    classes: Mapping[str, MayBe] = field(default_factory=dict)
    """What each coefficient that was found may be."""
    in_use: InUse | None = None
    """Metres without aid: with nothing, each model of the ladder, and what was found; None where there are none."""


@dataclass(frozen=True)
class Preview:
    """A candidate before it is added, by the linear model."""

    effect: Effect
    """The first, where a text gives several."""
    what: Addition
    residuals: data.Residuals
    """`before` and `after` it is added."""


class FitSession:
    """A recording with the fits made so far; safe for several pages at once."""

    def __init__(self, test: PreparedTest, model: Model) -> None:
        self.test, self.model = test, model
        self._fits: dict[Setting, Fitted] = {}
        self._missing: dict[Setting, Missing] = {}
        self._warm: tuple[Setting, Fit] | None = None
        self._surveyed: tuple[Setting, Diagnosis] | None = None
        self._lock = RLock()

    @property
    def stops(self) -> list[int]:
        """Stops with measurements."""
        return [int(s) for s in self.fit(Setting()).grid.stops]

    def known(self, setting: Setting) -> Fitted | None:
        """Return a fit that was made already."""
        return self._fits.get(setting)

    def known_in_use(self, setting: Setting) -> InUse | None:
        """Return the metres of a ladder where they were worked out already."""
        known = self._missing.get(setting)
        return None if known is None else known.in_use

    def fit(self, setting: Setting, tell: Tell = silent) -> Fitted:
        """Fit what a setting says; `tell` gets a word and the share done."""
        with self._lock:
            if setting not in self._fits:
                _keep(self._fits, setting, self._numbers(self._solved(setting, tell)))
            return self._fits[setting]

    def missing(self, setting: Setting, tell: Tell = silent) -> Missing:
        """Score all candidates against a fit, and diagnose it as `sdimu diagnose` does."""
        with self._lock:
            if setting not in self._missing:
                scores = self._survey(setting, tell)
                told = climb(scores.fit, progress=tell)
                summary = summarise(told)
                off = wrong_without(summary, ReportExtras(given=scores.after))
                found = Missing(
                    tuple(data.scored(scores)),
                    scores.found.threshold,
                    told.adequate,
                    summary.diagnosis.sentence,
                    scores.free_inputs_after,
                    scores.fit.held_out_rms(),
                    told.probabilities,
                    unknown_of(told),
                    _mended(summary),
                    off[0] if off else None,
                    classes_of(summary.found, told.probabilities),
                    self._in_metres(setting, scores.fit, told, tell),
                )
                _keep(self._missing, setting, found)
            return self._missing[setting]

    def preview(self, setting: Setting, text: str, tell: Tell = silent) -> Preview:
        """Look at an effect before it is added."""
        with self._lock:
            effects = added_effects(self._extended(setting), [text], self.test.imu)
            scores = self._survey(setting, tell)
            names, labels = list(scores.evidence.names), [label for e in effects for label in e.labels]
            if not set(labels) <= set(names):
                scores = replace(scores, evidence=scores.evidence.with_effects(effects))
                names = list(scores.evidence.names)
            columns = np.array([names.index(label) for label in labels], dtype=np.int64)
            what = addition(scores.fit, scores.evidence, columns.tolist(), looked_at(scores))
            chosen = replace(scores, found=replace(scores.found, chosen=columns))
            return Preview(effects[0], what, data.residuals(chosen))

    def objections(self, setting: Setting, tell: Tell = silent) -> tuple[str, ...]:
        """Say what speaks against the effects of a setting, each against the fit with those before it.

        Where no candidate stands out, the warnings about the fit come first; a verdict that names some needs none.
        """
        clean = self.missing(setting, tell).adequate
        warnings = self.fit(setting, tell).calibration.warnings if clean else ()
        out = list(without_advice(warnings))
        for count in range(1, len(setting.added) + 1):
            below, here = self.fit(setting.rung(count - 1), tell), self.fit(setting.rung(count), tell)
            out += objections(below.calibration, here.calibration, here.stated, (below.held_out, here.held_out))
        return tuple(dict.fromkeys(out))

    def final(self, setting: Setting, tell: Tell = silent) -> Diagnosis:
        """Fit once more from nothing, as `sdimu calibrate` does, so that it gives the same numbers."""
        with self._lock:
            fit = solve(self._left(setting), self._extended(setting), progress=tell)
            tell("candidates", 0.6)
            return survey(fit, outcome(fit))

    def _left(self, setting: Setting) -> PreparedTest:
        return self.test.without_stops(setting.held).without_times(setting.cut)

    def _extended(self, setting: Setting) -> Model:
        model = with_effects(self.model, added_effects(self.model, setting.added, self.test.imu))
        if not setting.priors:
            return model
        sensors = imu_model.build(model.effects, self.test.imu)
        units = {p.name: p.display_unit for p in sensors.parameters}
        return replace(model, priors=stated_priors(self.model.priors, setting.priors, units))

    def _solved(self, setting: Setting, tell: Tell) -> Fit:
        if self._warm is not None and self._warm[0] == setting:
            return self._warm[1]
        self._warm = self._surveyed = None
        test, model = self._left(setting), self._extended(setting)
        parent = self._fits.get(setting) or self._fits.get(setting.rung(len(setting.added) - 1))
        try:
            fit = solve(test, model, start=parent.start if parent else None, progress=tell)
        except DataError:
            if parent is None:
                raise
            fit = solve(test, model, progress=tell)
        if not fit.converged and parent is not None:
            fit = solve(test, model, progress=tell)
        self._warm = (setting, fit)
        return fit

    def _in_metres(self, setting: Setting, fit: Fit, told: Diagnosis, tell: Tell) -> InUse | None:
        """Navigate without aid with each model of a ladder and with what was found, as a report does.

        `fit`: of the setting; `told`: its diagnosis. None where the recording is too short, or by hand.
        """
        try:
            below = [self._once_more(setting.rung(count), tell) for count in range(len(setting.added))]
            first, *others = *below, fit
            rivals = [(f"+ {named(text)}", one) for text, one in zip(setting.added, others, strict=True)]
            rivals += [(FOUND, told.extended)] if len(told.found.chosen) else []
            return in_use(ReportExtras(trials=first.free_inertial(rivals)))
        except DataError:
            return None

    def _once_more(self, setting: Setting, tell: Tell) -> Fit:
        """Fit a setting with its matrices again; those that are kept stay in their place."""
        start = self.fit(setting, tell).start
        return solve(self._left(setting), self._extended(setting), start=start, progress=tell)

    def _survey(self, setting: Setting, tell: Tell) -> Diagnosis:
        if self._surveyed is None or self._surveyed[0] != setting:
            fit = self._solved(setting, tell)
            tell("candidates", 0.5)
            self._surveyed = (setting, survey(fit, _without_history(fit)))
        return self._surveyed[1]

    def _numbers(self, fit: Fit) -> Fitted:
        scores = survey(fit, _without_history(fit), with_candidates=False)
        everything = Problem(scores.evidence.only(np.empty(0, dtype=np.int64)))
        errors = _left_out(fit, self.test)
        seen = errors[np.isfinite(errors)]
        return Fitted(
            scores.after,
            fit.sensors.prior,
            fit.sensors.mean,
            fit.sensors.stated,
            data.where(scores.consistency),
            data.residuals(scores),
            scores.navigation.prepared.epochs.start,
            axes(scores),
            errors,
            everything.held_out([]).rms,
            float(np.sqrt(np.mean(seen**2))) if len(seen) else None,
            fit.start,
        )


def _without_history(fit: Fit) -> Calibration:
    # Only a report shows the history of the last pass.
    return replace(outcome(fit, held_out=False), history=no_history(len(fit.names)))


def _left_out(fit: Fit, whole: PreparedTest) -> Floats:
    """Normalised prediction errors (e, 12) of what a fit has not seen; NaN elsewhere."""
    if not isinstance(fit, NavigationFit):
        return np.empty((0, 12))
    seen = replace(fit, prepared=whole.data(fit.setup))
    out = (fit.prepared.kind == SKIP) & (seen.prepared.kind != SKIP)
    if not out.any():
        return np.full((len(out), 12), np.nan)
    return np.where(out[:, None], seen.predict(out), np.nan)


def _keep(kept: dict[Setting, Any], setting: Setting, value: Any) -> None:
    """Keep what was worked out of a fit; the oldest goes when there are too many."""
    while len(kept) >= _MOST_KEPT:
        kept.pop(next(iter(kept)))
    kept[setting] = value


def _mended(summary: DiagnosisSummary) -> bool:
    word = summary.diagnosis.verdict
    return word == Verdict.CLASS_OF_EFFECTS or (bool(summary.candidates) and word != Verdict.DATA_FAULT)
