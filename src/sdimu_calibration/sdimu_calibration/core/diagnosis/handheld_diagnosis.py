"""Which effect is missing in a hand-held run: fit, look, add the best, fit again, until nothing stands out.

No specification says how far a cheap sensor in a hand may miss, so the fit learns it (`handheld_fit`), and what a
missing effect does is learned along with it. A candidate must therefore stand out of the scatter of its own run; once
it is in the model the learned sigmas fall, and that is how far the error fell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.diagnosis.candidates import Candidate, catalogue, equations, periodic
from sdimu_calibration.core.diagnosis.handheld_evidence import HandheldEvidence, collect, forget, timetable
from sdimu_calibration.core.diagnosis.rounds import LEAST_SIGMAS, mark_dropped
from sdimu_calibration.core.diagnosis.scan import Scan, alike
from sdimu_calibration.core.diagnosis.search import FALSE_ALARM, Problem, Search, Step, search
from sdimu_calibration.core.effects import imu_model
from sdimu_calibration.core.effects.effect import Effect, Timetable
from sdimu_calibration.core.handheld.handheld import PreparedRun, assemble, first_linearisation, fit_priors, prepare
from sdimu_calibration.core.handheld.handheld_fit import FitPriors, HandheldSolution, LinearisationPoint, fit_run
from sdimu_calibration.core.probability import normal_tail
from sdimu_calibration.core.progress import Progress
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.specification import ImuSpecification, Model, Site

MOST_EFFECTS = 6
_NOT_BY_HAND = ("reference", "gyro_lost_data", "gyro_delay", "accel_delay")
"""There is no reference but gravity; a turn by hand may miss anyhow, by a sigma that is learned."""


@dataclass(frozen=True)
class HandheldRung:
    """One fit on the ladder.

    Attributes
    ----------
    added : str
        What this model has beyond the one before; empty for the first.
    log_likelihood : float
        Marginal: the difference of two is a log Bayes factor.
    extra : ndarray, shape (3,)
        What is left beyond white noise: force (m/s^2), rate (rad/s), turn (share of the way).
    held_out : float
        RMS error at rests left out, in sigmas of the last model.
    """

    added: str
    log_likelihood: float
    extra: Floats
    held_out: float


@dataclass(frozen=True)
class HandheldDiagnosis:
    """What was asked of a hand-held run, and what it answered.

    Attributes
    ----------
    verdict : str
        ``consistent``, ``one effect``, ``class of effects``, ``several effects``, ``own equation``, ``unexplained`` or
        ``data fault``.
    adequate : bool
    p_value : float
        That a right model has a candidate as large as this, all candidates counted.
    before, after : Calibration
        With the model as given, and with what was found added (the same object when nothing was).
    steps : tuple of Step
        What was tried, in order, in sigmas of the fit that it was tried on; those taken out later say why.
    rungs : tuple of HandheldRung
        The model as given, then one for each effect that was found.
    evidence : HandheldEvidence
        About the last fit, what was found among the candidates.
    chosen : ndarray of int
        Columns of the evidence that were found.
    first : Scan
        Of the model as given, with the sigmas learned with it.
    threshold : float
        Of that scan.
    own : bool
        An equation is among what was found.
    """

    verdict: str
    adequate: bool
    p_value: float
    before: Calibration
    after: Calibration
    steps: tuple[Step, ...]
    rungs: tuple[HandheldRung, ...]
    evidence: HandheldEvidence
    chosen: Ints
    first: Scan
    threshold: float
    own: bool


def diagnose_handheld(
    recording: Recording,
    site: Site | None,
    imu: ImuSpecification,
    model: Model,
    extra: Sequence[Effect] = (),
    alpha: float = FALSE_ALARM,
    progress: Progress | None = None,
) -> HandheldDiagnosis:
    """Find what the model of a hand-held run is missing.

    Parameters
    ----------
    recording, site, imu, model
        As for `hand_calibrate`.
    extra : sequence of Effect
        Effects of the user's own, tried with the catalogue.
    alpha : float
        False-alarm probability of a whole scan.
    progress : callable, optional

    Raises
    ------
    DataError
        When the recording cannot be used, as for `hand_calibrate`.
    """
    tell = progress or (lambda _what, _fraction: None)
    tell("rests", 0.05)
    climber = _Climber(prepare(recording), site, imu, model, tuple(extra), alpha, tell)
    climber.climb()
    tell("report", 0.9)
    return climber.account()


@dataclass(frozen=True)
class _Fitted:
    """A model and its fit."""

    added: tuple[Candidate, ...]
    scene: FitPriors
    fit: HandheldSolution


class _Climber:
    """Adds one effect after the other and keeps what each fit said."""

    def __init__(
        self, ready: PreparedRun, site: Site | None, imu: ImuSpecification, model: Model, extra: tuple[Effect, ...],
        alpha: float, tell: Progress,
    ) -> None:  # fmt: skip
        self.ready, self.site, self.imu, self.model = ready, site, imu, model
        self.extra, self.alpha, self.tell = extra, alpha, tell
        self.steps: list[Step] = []
        self.looks: list[Search[HandheldEvidence]] = []
        self.weak: set[str] = set()
        tell("least squares", 0.1)
        self.fits = [self._fit((), None)]

    def climb(self) -> None:
        """Go on until nothing stands out, something is refused, or what is added does not last."""
        seen = {frozenset[str]()}
        while len(self.fits) <= MOST_EFFECTS:
            here = self.fits[-1]
            self.tell("candidates", min(0.8, 0.2 + 0.1 * len(self.steps)))
            step, candidate = self._look(here)
            if step is None:
                return
            self.steps.append(step)
            if candidate is None:
                return
            self.tell("least squares", min(0.85, 0.25 + 0.1 * len(self.steps)))
            self.fits.append(self._fit((*here.added, candidate), here))
            self._choose_anew()
            self._drop_weak()
            chosen = frozenset(c.label for c in self.fits[-1].added)
            if chosen in seen:
                return
            seen.add(chosen)

    def _choose_anew(self) -> None:
        """Search in the sigmas of the last fit as if nothing had been added: it sees what the scatter hid before.

        What was added first was chosen in a scatter that it made itself, and two or three effects may stand for one.
        Another choice of as many or fewer is taken when its fit is the more likely.
        """
        last = self.fits[-1]
        own = any(c.family == "own" for c in last.added)
        evidence = forget(self._evidence(last, own), len(last.added), last.added)
        found = search(evidence, np.arange(len(evidence.weight), len(evidence.names)), self.alpha)
        chosen = [found.evidence.candidates[c - len(evidence.weight)] for c in found.chosen]
        if not 0 < len(chosen) <= len(last.added) or {c.label for c in chosen} == {c.label for c in last.added}:
            return
        fits = self._ladder(chosen)
        if fits[-1].fit.log_likelihood > last.fit.log_likelihood:
            self.fits = fits
            known = {step.label for step in self.steps}
            new = {c.label for c in chosen} - known
            self.steps += [step for step in found.steps if step.accepted and step.label in new]

    def _drop_weak(self) -> None:
        """Drop the weakest of what was added below three of its sigmas, one at a time."""
        while self.fits[-1].added:
            sizes = _sizes(self.fits[-1])
            weakest = int(np.argmin(sizes))
            if sizes[weakest] >= LEAST_SIGMAS:
                return
            added = self.fits[-1].added
            self.weak.add(added[weakest].label)
            self.fits = self._ladder([*added[:weakest], *added[weakest + 1 :]])

    def _ladder(self, added: Sequence[Candidate]) -> list[_Fitted]:
        """Fit the model as given with the first, the first two, ... of what is added."""
        fits = self.fits[:1]
        for k in range(len(added)):
            fits = [*fits, self._fit(tuple(added[: k + 1]), fits[-1])]
        return fits

    def _fit(self, added: tuple[Candidate, ...], parent: _Fitted | None) -> _Fitted:
        """Fit the model with more effects, from where the one before ended."""
        run = self.ready.run
        sensors = imu_model.build([*self.model.effects, *(c.effect for c in added)], self.imu)
        scene = fit_priors(sensors, self.imu, self.site, self.ready.rests)
        start = (
            first_linearisation(run, sensors, scene.gravity) if parent is None else _onward(parent.fit.point, sensors)
        )
        return _Fitted(added, scene, fit_run(run, scene, start))

    def _look(self, here: _Fitted) -> tuple[Step | None, Candidate | None]:
        """Search the catalogue, and equations when it has nothing; the first step only, as the fit comes next."""
        for own in (False, True):
            evidence = self._evidence(here, own)
            found = search(evidence, np.arange(len(evidence.weight), len(evidence.names)), self.alpha)
            if not own:
                self.looks.append(found)
            if found.steps and found.steps[0].accepted:
                step = found.steps[0]
                return step, next(c for c in found.evidence.candidates if c.label == step.label)
        refused = self.looks[-1].steps
        return (refused[0] if refused else None), None

    def _evidence(self, here: _Fitted, own: bool) -> HandheldEvidence:
        labels = {label for effect in here.scene.model.effects for label in effect.labels}
        effects = candidates(timetable(self.ready.run), labels, self.ready.run.temperature is not None, self.extra, own)
        return collect(self.ready.run, here.scene, here.fit.point, effects, self.imu.grade)

    def account(self) -> HandheldDiagnosis:
        """Put together what was found, all of it in sigmas of the last fit."""
        last = self.fits[-1]
        own = any(c.family == "own" for c in last.added)
        evidence = forget(self._evidence(last, own), len(last.added), last.added)
        p, m = len(evidence.weight), len(last.added)
        chosen = np.arange(p, p + m)
        problem = Problem(evidence)
        rungs = tuple(
            HandheldRung(
                f.added[-1].label if f.added else "", f.fit.log_likelihood, f.fit.point.extra,
                problem.held_out([int(c) for c in chosen[:k]], 1.0).rms,
            )
            for k, f in enumerate(self.fits)
        )  # fmt: skip
        before = assemble(self.ready, self.fits[0].scene, self.fits[0].fit, self.site, self.model)
        after = assemble(self.ready, last.scene, last.fit, self.site, self.model) if m else before
        first, steps = self.looks[0], mark_dropped(self.steps, {c.label for c in last.added}, self.weak)
        twins = alike(problem.scores(problem.scan([])), int(chosen[0])) if m == 1 else []
        verdict = _verdict(last.added, bool(self.steps), bool(twins), after)
        return HandheldDiagnosis(
            verdict, verdict == "consistent", _p_value(first.first), before, after, steps, rungs, evidence,
            chosen, first.first, first.threshold, own,
        )  # fmt: skip


def candidates(
    times: Timetable, in_model: set[str], has_temperature: bool, extra: Sequence[Effect], own: bool
) -> list[Effect]:
    """Effects that a hand-held run may show: constants, and none of the table's and of the place's."""
    more = [*equations(has_temperature), *periodic(times.duration)] if own else []
    known = [*extra, *catalogue(times, in_model, has_temperature), *more]
    return [
        effect for effect in known
        if not (effect.family or effect.name).startswith(_NOT_BY_HAND)
        and not effect.random_walk and effect.decay_s is None and not in_model & set(effect.labels)
    ]  # fmt: skip


def _onward(point: LinearisationPoint, sensors: imu_model.ImuModel) -> LinearisationPoint:
    """Start where a fit with fewer effects ended."""
    more = len(sensors.prior) - len(point.coefficients)
    return replace(point, coefficients=np.concatenate([point.coefficients, np.zeros(more)]))


def _sizes(fitted: _Fitted) -> Floats:
    """Size of every effect that was added, in its sigmas."""
    m = len(fitted.added)
    values = fitted.fit.point.coefficients[-m:]
    return np.asarray(np.abs(values) / np.sqrt(np.diag(fitted.fit.covariance)[-m:]))


def _p_value(first: Scan) -> float:
    """Bonferroni over the scan."""
    count = int(np.isfinite(first.sigma).sum())
    return float(min(1.0, count * 2.0 * normal_tail(float(np.max(np.abs(first.z), initial=0.0)))))


def _verdict(added: tuple[Candidate, ...], tried: bool, twins: bool, after: Calibration) -> str:
    if after.warnings:
        return "data fault"
    if not added:
        # Something stood out and was refused or did not last.
        return "unexplained" if tried else "consistent"
    if any(c.family == "own" for c in added):
        return "own equation"
    if len(added) > 1:
        return "several effects"
    return "class of effects" if twins else "one effect"
