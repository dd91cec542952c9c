"""Is the model adequate, where does it fail, which effect is missing? The order of work is that of the files here.

Screen of the data; noise scale; consistency; posterior over models of effects and noise; free-input test; equations
outside the catalogue; refit of what was found; coefficients over all probable models. Design: doc/diagnosis.md.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sdimu_calibration.core.arrays import Ints
from sdimu_calibration.core.diagnosis.averaged import over_all_models
from sdimu_calibration.core.diagnosis.free_input_test import FreeInputTest
from sdimu_calibration.core.diagnosis.ground import Request
from sdimu_calibration.core.diagnosis.ladder import Rung, ladder
from sdimu_calibration.core.diagnosis.rounds import UNEXPLAINED_P, Round, in_found_noise, search_until_stable
from sdimu_calibration.core.diagnosis.screen import Finding, screen
from sdimu_calibration.core.diagnosis.search import FALSE_ALARM, Search, alike_in_window
from sdimu_calibration.core.diagnosis.verdict import Facts, sentence, verdict
from sdimu_calibration.core.diagnosis.white_noise import without_memory
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.error_figures import degrees_of_freedom, held_out_judged, nis_judged
from sdimu_calibration.core.estimation.fit import NOT_CONVERGED, Fit
from sdimu_calibration.core.estimation.noise_estimate import term_in_words
from sdimu_calibration.core.estimation.noise_learning import in_white_noise
from sdimu_calibration.core.estimation.outcome import doubted, outcome
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import AUTO, solve
from sdimu_calibration.core.evidence.candidate import Candidate
from sdimu_calibration.core.evidence.consistency import Consistency
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.evidence.navigation_evidence import NavigationEvidence
from sdimu_calibration.core.posterior.told import Probabilities, Share, may_be, probabilities
from sdimu_calibration.core.probability import normal_tail
from sdimu_calibration.core.progress import Progress, silent
from sdimu_calibration.core.recording import DataError, Recording
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.specification import EPOCH_S, ImuSpecification, Model, Site
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.core.wording import Option

STILL_WRONG = 1.25
"""Held-out error (sigma) from which a model is not called explained: 1 is right, and an effect that only imitates the
cause fits here and fails elsewhere."""
NOISE_OFF = 0.05
"""Deviation of the white noise from its specification, as a share, from which it is reported and corrected: all sigmas
go with it."""
_KURTOSIS = 4.0
"""Kurtosis of the differences of neighbouring seconds (1) from which tails are heavy: Gaussian noise in a test of an
hour stays below 3.3."""
_MISFIT = 0.05
"""Excess of the NIS per degree of freedom (1) up to which a model fits: its sigmas are then right to 2.5 %."""
_MISFIT_SIGMAS = 5.0
"""Excess of the NIS (standard deviations of it) up to which a model fits: in a short test chance goes beyond
`_MISFIT`."""
_OPEN = 0.05
"""Probability (1) from which something that looks the same is named in the sentence: one in twenty."""
_PATCHES = 3
"""Number of drifts of one bias from which they are a patchwork: together they follow any wander."""
_TO_AND_FRO = (
    "the search for missing effects went to and fro between choices that explain about the same, and was ended: of "
    "these one is named, and another may be right"
)
"""Finding where the search did not come to an end by itself."""
NOT_DIAGNOSABLE = (
    "the classical estimator gives coefficients in the axes of the table: a navigation about them shows the mount, and "
    f"no missing effect; diagnose with another {Option.ESTIMATOR} (in Python estimator=...)"
)
"""Why a classical fit is not diagnosed."""


@dataclass(frozen=True)
class Diagnosis:
    """What a diagnosis found.

    Attributes
    ----------
    verdict : Verdict
        Of a `survey`: consistent or misfit.
    sentence : str
        The verdict for people.
    adequate : bool
    p_value : float
        Probability that a right model in white noise looks like this, from scan, free inputs and NIS together.
    findings : tuple of Finding
        Of the data screen.
    noise : tuple of str
        What is wrong with the noise model, one line each.
    consistency : Consistency
        Of the model as given.
    fit, extended : Fit
        With the model as given, and with what was found added; the latter with doubt about its model.
    before, after : Calibration
        Their results.
    found : Search
        Of the catalogue, or of own equations where those explain it.
    evidence : LinearEvidence
    free_inputs_before, free_inputs_after : FreeInputTest
    free : ndarray of int, shape (f,)
        Columns of the free inputs in `evidence`.
    own : bool
        What was found are own equations, not registered effects.
    unexplained : bool
    rungs : tuple of Rung
        The fit as given and with each found effect added; empty where it was not asked for.
    """

    verdict: Verdict
    sentence: str
    adequate: bool
    p_value: float
    findings: tuple[Finding, ...]
    noise: tuple[str, ...]
    consistency: Consistency
    fit: Fit
    extended: Fit
    before: Calibration
    after: Calibration
    found: Search[LinearEvidence]
    evidence: LinearEvidence
    free_inputs_before: FreeInputTest
    free_inputs_after: FreeInputTest
    free: Ints
    own: bool
    unexplained: bool
    rungs: tuple[Rung, ...] = ()

    @property
    def chosen(self) -> tuple[Candidate, ...]:
        """What was found: the largest share of the misfit first."""
        p = len(self.evidence.weight)
        return tuple(self.evidence.candidates[i - p] for i in self.found.chosen)

    @property
    def alike(self) -> tuple[str, ...]:
        """What the data cannot tell from the first of `chosen`."""
        return alike_first(self)

    @cached_property
    def probabilities(self) -> Probabilities | None:
        """Probability of nothing, of each family of effects, of each noise; None of a `survey`."""
        return None if self.found.posterior is None else probabilities(self.found.posterior, self.found.noise)

    def may_be(self, column: int) -> tuple[float, tuple[Share, ...]]:
        """Probability that a chosen column or something of its class is missing; coefficients that it may be."""
        window = self.found.posterior
        if window is None:
            return float("nan"), ()
        place = window.place_of(column)
        return window.of_class(place), may_be(window, place)

    def is_open(self, candidate: Candidate) -> bool:
        """Whether something that looks the same may well be there in the place of a chosen candidate."""
        _, shares = self.may_be(int(self.found.chosen[self.chosen.index(candidate)]))
        return any(s.probability > _OPEN for s in shares if s.name != candidate.coefficient)

    @property
    def navigation(self) -> NavigationEvidence:
        """The evidence of a fit that navigates.

        Raises
        ------
        TypeError
            When the fit is that of a handheld run.
        """
        if not isinstance(self.evidence, NavigationEvidence):
            raise TypeError(f"a {self.fit.estimator} fit has no innovations of a navigation")
        return self.evidence

    @property
    def explained(self) -> float:
        """Share of the misfit that what was found removes; NaN where no free inputs are testable."""
        if not len(self.free):
            return float("nan")
        before = max(self.free_inputs_before.chi2 - self.free_inputs_before.dof, 1e-9)
        after = max(self.free_inputs_after.chi2 - self.free_inputs_after.dof, 0.0)
        return float(np.clip(1.0 - after / before, 0.0, 1.0))


def diagnose(
    recording: Recording,
    site: Site | None,
    imu: ImuSpecification,
    model: Model,
    extra: Sequence[Effect] = (),
    progress: Progress = silent,
    estimator: str = AUTO,
) -> Diagnosis:
    """Solve, then `climb`; parameters as for `PreparedTest`, `solve` and `climb`."""
    return climb(solve(PreparedTest(recording, imu, site), model, estimator, progress=progress), extra, progress)


def climb(
    fit: Fit,
    extra: Sequence[Effect] = (),
    progress: Progress = silent,
    alpha: float = FALSE_ALARM,
    refits: bool = False,
    without: Collection[str] = (),
) -> Diagnosis:
    """Find what the model of a fit is missing.

    Parameters
    ----------
    fit : Fit
        With the model as given.
    extra : sequence of Effect
        Effects of the user's own, tried with the catalogue.
    progress : callable
        Called with a word and the fraction done.
    alpha : float
        False-alarm probability of a whole scan.
    refits : bool
        Also fit the model with the first, the first two, ... of what was found.
    without : collection of str
        Registry names of effects that are not tried, as if the catalogue lacked them.
    """
    if not fit.diagnosable:
        raise DataError(NOT_DIAGNOSABLE)
    stated = fit.test.imu
    base, consistency, noise = in_measured_noise(fit, progress)
    wander = None if base.learns_scatter else base.wander
    request = Request(base, tuple(extra), alpha, wander, frozenset(without))
    done = search_until_stable(request, progress)
    widened = over_all_models(base, done)
    # Beside what was found a prior may no longer stand against the data: the fit of the model as given tells it.
    odd = [*base.contradicted_priors(), *widened.beyond_specification()]
    findings = (*screen(base), *(Finding(text, grave=False) for text in odd))
    findings += () if done.found.stood else (Finding(_TO_AND_FRO, grave=False),)
    findings += () if widened.converged else (Finding(NOT_CONVERGED, grave=True),)
    progress("report", 0.9)
    if base.learns_scatter:
        consistency = base.consistency(done.evidence)
    if done.found.noise:
        consistency = without_memory(consistency, done.found.noise, stated)
        noise, _ = measured_noise(consistency, base)
    # In the noise that was learned without the effects nothing would be seen to be missing.
    as_given = in_found_noise(request, base, done.found.noise) if done.chosen else done.fit
    # A missing effect that is found may be so large that without it there is no fit at all.
    before = outcome(as_given, refuse=not done.chosen)
    after = doubted(outcome(done.fit) if done.chosen else before, widened)
    own = any(c.family == "own" for c in done.chosen)
    # What was added must also predict: an effect that only mimics the missing one fits here and fails elsewhere.
    # The free inputs are constant in a dwell and in a turn; what changes within one shows in the NIS alone.
    # Noise that is faster than a stretch is learned by what it leaves from stretch to stretch; within, it stays.
    # Neighbouring epochs say what the noise is, but for a sensor that counts pulses.
    judged = not (base.learns_scatter or done.found.noise or stated.epoch_s > EPOCH_S)
    excess = misfit(after, consistency, stated, base.test.imu) if judged else 0.0
    loud = excess > largest_misfit(float(np.fmax(degrees_of_freedom(after), 1.0)))
    still = not base.learns_scatter and held_out_judged(after) > STILL_WRONG
    # Wrong samples in turns leave noise that looks drawn anew in each turn.
    spoilt = any(finding.kind == "spike" for finding in findings)
    drawn = not spoilt and any(term.is_drawn for term in done.found.noise)
    unexplained = done.left_after.p_value < UNEXPLAINED_P or still or loud or drawn or patchwork(done.chosen)
    noise += tuple(term_in_words(term) for term in done.found.noise)
    rungs = ladder(as_given, widened, done, progress) if refits or base.learns_scatter else ()
    facts = Facts(done.found, done.chosen, alike_first(done), findings, noise, own, unexplained)
    word = verdict(facts)
    progress("done", 1.0)
    unspoken = Diagnosis(
        word,
        "",
        word == Verdict.CONSISTENT,
        p_value(done, consistency, bool(noise) or loud),
        findings,
        noise,
        consistency,
        as_given,
        widened,
        before,
        after,
        done.found,
        done.evidence,
        done.left_before,
        done.left_after,
        done.free,
        own,
        unexplained,
        rungs,
    )
    return replace(unspoken, sentence=sentence(unspoken))


def in_measured_noise(fit: Fit, progress: Progress = silent) -> tuple[Fit, Consistency, tuple[str, ...]]:
    """Fit in white noise, of the size that the recording shows where the IMU file is wrong about it.

    Parameters
    ----------
    fit : Fit
    progress : callable

    Returns
    -------
    fit : Fit
    consistency : Consistency
        Of the fit as it was given.
    noise : tuple of str
        What is wrong in the IMU file, one line each.
    """
    consistency = fit.consistency()
    noise, imu = measured_noise(consistency, fit)
    if noise:
        again = solve(
            fit.test.with_imu(imu),
            fit.model,
            fit.estimator,
            progress=progress,
            learn=False,
            azimuth_free=fit.azimuth_free,
        )
        fit = replace(again, reason=fit.reason)
    return in_white_noise(fit), consistency, noise


def alike_first(of: Round | Diagnosis) -> tuple[str, ...]:
    """Labels of what the data cannot tell from the first effect of a choice, the others being in the model."""
    chosen = of.found.chosen
    if not len(chosen):
        return ()
    return alike_in_window(of.found.posterior, int(chosen[0])) if of.found.posterior else ()


def misfit(final: Calibration, consistency: Consistency, stated: ImuSpecification, taken: ImuSpecification) -> float:
    """Excess of the NIS over what the noise of the recording itself explains, outliers and all.

    Differences of neighbouring seconds say what that noise is, whatever is slow.

    Parameters
    ----------
    final : Calibration
    consistency : Consistency
        Measured against `stated`.
    stated, taken : ImuSpecification
        Noise of the IMU file, and noise that the fit took.
    """
    gyro = consistency.gyro.spread * stated.gyro_white_noise / taken.gyro_white_noise
    accel = consistency.accel.spread * stated.accel_white_noise / taken.accel_white_noise
    return float(nis_judged(final) / (0.5 * (gyro**2 + accel**2)) - 1.0)


def largest_misfit(dof: float) -> float:
    """Excess of the NIS that a right model stays below.

    The NIS and the differences of neighbours are two estimates of one variance, the second with an efficiency of 2/3
    (Rice, Ann. Stat. 12, 1984): their ratio scatters by ``1/sqrt(dof)``.
    """
    return max(_MISFIT, _MISFIT_SIGMAS / float(np.sqrt(dof)))


def patchwork(chosen: Iterable[Candidate]) -> bool:
    """Whether one bias drifts by so many effects at once that they follow any wander and say nothing of its cause."""
    drifts = {(c.family, c.effect.variant, c.effect.terms[0].channel) for c in chosen if c.effect.bias_drift}
    of_sensor = [sensor for _, _, sensor in drifts]
    return any(of_sensor.count(sensor) >= _PATCHES for sensor in of_sensor)


def measured_noise(consistency: Consistency, fit: Fit) -> tuple[tuple[str, ...], ImuSpecification]:
    """Say where the white noise is not as specified, and put the measured one in its place.

    Noise with heavy tails is taken at its standard deviation, outliers and all. To leave the outliers out of the
    measurements instead would be wrong: the same samples drive the navigation, and it is the measurement that
    tells the filter what they did to it.
    """
    told: list[str] = []
    scales = {"gyro": 1.0, "accel": 1.0}
    for triad, noise in (("gyro", consistency.gyro), ("accel", consistency.accel)):
        if abs(noise.ratio - 1.0) > max(NOISE_OFF, 4.0 * noise.sigma):
            scales[triad] = noise.ratio
            told.append(f"{triad} white noise is {noise.ratio:.2f} +- {noise.sigma:.2f} times the specification")
        if noise.kurtosis > _KURTOSIS:
            scales[triad] = noise.spread
            share = 100 * len(noise.outliers) / max(1, consistency.seconds)
            told.append(
                f"{triad} noise has heavy tails: kurtosis {noise.kurtosis:.1f} (3 is Gaussian), {share:.1f} % of the "
                f"seconds are outliers, with them it is {noise.spread:.2f} times the specification"
            )
    return tuple(told), fit.test.imu.with_noise_times(**scales)


def p_value(done: Round, consistency: Consistency, noise: bool) -> float:
    """Probability that a right model in white noise looks like this, by scan, free inputs and NIS (Bonferroni).

    Parameters
    ----------
    done : Round
        Its first scan, and its free-input test with nothing added.
    consistency : Consistency
        Of the model as given, in white noise.
    noise : bool
        Whether the NIS counts: the noise is not as specified, or something faster than a dwell is left.
    """
    first = done.found.first
    largest = float(np.max(np.abs(first.z), initial=0.0))
    count = int(np.isfinite(first.sigma).sum())
    of_scan = min(1.0, count * 2.0 * normal_tail(largest))
    if not len(done.free):
        return float(of_scan)
    of_noise = consistency.nis_p_value if noise else 1.0
    return float(min(1.0, 3.0 * min(of_scan, done.left_before.p_value, of_noise)))
