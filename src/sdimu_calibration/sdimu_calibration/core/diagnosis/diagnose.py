"""Is the model adequate, where does it fail, which effect is missing? The order of work is that of the files here.

Screen of the data; noise scale; consistency; posterior over models of effects and noise; free-input test; equations
outside the catalogue; refit of what was found; coefficients over all probable models. Design: doc/diagnosis.md.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sdimu_calibration.core.arrays import Ints
from sdimu_calibration.core.diagnosis.alarms import Alarm, alarms
from sdimu_calibration.core.diagnosis.averaged import over_all_models
from sdimu_calibration.core.diagnosis.found import Found, found_effects
from sdimu_calibration.core.diagnosis.free_input_test import FreeInputTest
from sdimu_calibration.core.diagnosis.ground import Request
from sdimu_calibration.core.diagnosis.ladder import Rung, ladder
from sdimu_calibration.core.diagnosis.measured_noise import in_measured_noise, is_stated, measured_noise, of_other_grade
from sdimu_calibration.core.diagnosis.rounds import TO_AND_FRO, Round, in_found_noise, searched
from sdimu_calibration.core.diagnosis.screen import Finding, screen
from sdimu_calibration.core.diagnosis.search import FALSE_ALARM, Search
from sdimu_calibration.core.diagnosis.verdict import Facts, statements, verdict
from sdimu_calibration.core.diagnosis.white_noise import without_memory
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.estimation.fit import NOT_CONVERGED, Fit
from sdimu_calibration.core.estimation.noise_estimate import term_in_words
from sdimu_calibration.core.estimation.outcome import doubted, outcome
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import AUTO, solve
from sdimu_calibration.core.evidence.candidate import Candidate
from sdimu_calibration.core.evidence.consistency import Consistency
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.evidence.navigation_evidence import NavigationEvidence
from sdimu_calibration.core.plain_text import capital
from sdimu_calibration.core.posterior.told import Probabilities, Share, may_be, probabilities
from sdimu_calibration.core.progress import Progress, silent
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.specification import ImuSpecification, Model, Site
from sdimu_calibration.core.verdict import Verdict


@dataclass(frozen=True)
class Diagnosis:
    """What a diagnosis found."""

    verdict: Verdict
    """Of a `survey`: consistent or misfit."""
    statements: tuple[str, ...]
    """The verdict for people: what was found by how sure it is, then what is left."""
    adequate: bool
    p_value: float
    """Probability that a right model in white noise looks like this, from scan, free inputs and NIS together."""
    findings: tuple[Finding, ...]
    noise: tuple[str, ...]
    """What is wrong with the noise model, one line each."""
    consistency: Consistency
    """Of the model as given."""
    fit: Fit
    extended: Fit
    """`fit`, `extended`: with the model as given, and with what was found added; the latter with doubt about its model.
    """
    before: Calibration
    after: Calibration
    found: Search[LinearEvidence]
    """Of the catalogue, or of own equations where those explain it."""
    evidence: LinearEvidence
    free_inputs_before: FreeInputTest
    free_inputs_after: FreeInputTest
    free: Ints
    """Columns of the free inputs in `evidence`, shape (f,)."""
    own: bool
    """What was found are own equations, not registered effects."""
    alarms: frozenset[Alarm]
    """What speaks against a model that has all of this."""
    rungs: tuple[Rung, ...] = ()
    """The fit as given and with each found effect added; empty where it was not asked for."""
    found_effects: tuple[Found, ...] = ()
    """What was found, one at a time; when the verdict is ``unexplained`` what was tried."""

    @property
    def sentence(self) -> str:
        """The statements in one text."""
        return " ".join(self.statements)

    @property
    def chosen(self) -> tuple[Candidate, ...]:
        """What was found: the largest share of the misfit first."""
        return self.found.candidates

    @property
    def unexplained(self) -> bool:
        """Whether an alarm speaks against a model that has what was found."""
        return bool(self.alarms)

    @property
    def alike(self) -> tuple[str, ...]:
        """What the data cannot tell from the first of `chosen`."""
        return self.found.alike(0)

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
    stated = fit.test.imu
    base, consistency, noise = in_measured_noise(fit, progress)
    wander = None if base.learns_scatter else base.wander.in_white
    request = Request(base, tuple(extra), alpha, wander, frozenset(without))
    request, done = searched(request, progress)
    widened = over_all_models(base, done)
    findings = _findings(base, widened, done)
    progress("report", 0.9)
    if base.learns_scatter:
        consistency = base.consistency(done.evidence)
    if done.found.noise:
        consistency = without_memory(consistency, done.found.noise, stated)
        noise = (*of_other_grade(noise), *measured_noise(consistency, base)[0])
    # In the noise that was learned without the effects nothing would be seen to be missing.
    as_given = in_found_noise(request, base, done.found.noise) if done.chosen else done.fit
    # A missing effect that is found may be so large that without it there is no fit at all.
    before = outcome(as_given, refuse=not done.chosen)
    after = doubted(outcome(done.fit) if done.chosen else before, widened.values, widened.covariance)
    after = after if done.found.stood else after.warned(TO_AND_FRO)
    own = any(c.family == "own" for c in done.chosen)
    raised = alarms(done, after, consistency, base, stated, findings)
    noise += tuple(term_in_words(term) for term in done.found.noise if not is_stated(term, stated))
    rungs = ladder(request, as_given, widened, done, progress) if refits or base.learns_scatter else ()
    word = verdict(_facts(done, any(f.grave for f in findings), bool(raised), own, bool(noise)))
    progress("done", 1.0)
    unspoken = Diagnosis(
        word,
        (),
        word == Verdict.CONSISTENT,
        p_value(done, consistency, bool(noise) or Alarm.NIS in raised),
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
        raised,
        rungs,
    )
    found = found_effects(unspoken)
    said = statements(unspoken, found)
    said = (f"{_beside_wrong_prior(base, done)}{said[0]}", *said[1:])
    return replace(unspoken, statements=said, found_effects=found)


def _beside_wrong_prior(base: Fit, done: Round) -> str:
    """Say before what was found that a stated prior contradicts the data: effects may be there for its sake alone."""
    against = base.contradicted_priors() if done.chosen else []
    return f"{capital(against[0])}. If it holds all the same: " if against else ""


def _facts(done: Round, grave: bool, unexplained: bool, own: bool, noise: bool) -> Facts:
    found, window = done.found, done.found.posterior
    of_unit = [k for k, c in enumerate(done.chosen) if c.effect.scope != "recording"]
    effects = [(done.chosen[k].label, found.alike(k)) for k in of_unit]
    nothing = 1.0 if window is None else window.nothing
    return Facts(effects, len(done.chosen) - len(of_unit), grave, unexplained, own, nothing, noise)


def _findings(base: Fit, widened: Fit, done: Round) -> tuple[Finding, ...]:
    """Faults of the data, and what else is odd, of the fits as given and with what was found."""
    # Beside what was found a prior may no longer stand against the data: the fit of the model as given tells it.
    odd = [*base.contradicted_priors(), *widened.beyond_specification()]
    findings = (*screen(base), *(Finding(text, grave=False) for text in odd))
    findings += () if done.found.stood else (Finding(TO_AND_FRO, grave=False),)
    return findings if widened.converged else (*findings, Finding(NOT_CONVERGED, grave=True))


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
    of_scan = done.found.p_value
    if not len(done.free):
        return of_scan
    of_noise = consistency.nis_p_value if noise else 1.0
    return float(min(1.0, 3.0 * min(of_scan, done.left_before.p_value, of_noise)))
