"""Round, choose, linearise again about what was chosen, look again, until the choice stands.

A large effect that is not in the model bends the trajectory about which everything is linear, and the error of that
looks like small companions of the effect. So each round calibrates with what the last one chose, takes the evidence
there, and lets the search start afresh: what was chosen is one candidate among the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Ints
from sdimu_calibration.core.diagnosis.candidates import catalogue, equations, free_inputs, periodic
from sdimu_calibration.core.diagnosis.free_input_test import FreeInputTest, free_input_test
from sdimu_calibration.core.diagnosis.search import Search, Step, search
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.effects.imu_model import build
from sdimu_calibration.core.evidence.candidate import Candidate, split
from sdimu_calibration.core.evidence.navigation_evidence import Evidence, collect, timetable
from sdimu_calibration.core.filter.passes import Solution, solve
from sdimu_calibration.core.progress import Progress

UNEXPLAINED_P = 1e-3
"""A free-input remainder less probable than this is not noise."""
MOST_ROUNDS = 4
LEAST_SIGMAS = 3.0
"""What is smaller than this many of its sigmas once it is in the calibration is dropped."""
_MANY = 3
"""So many catalogue terms are suspicious: one equation may do."""


@dataclass(frozen=True)
class Round:
    """One round.

    Attributes
    ----------
    solution : Solution
        Calibration about which this round is linear: the model with `tried`.
    evidence : Evidence
    free : ndarray of int
        Columns of the free inputs in `evidence`.
    found : Search
    before, after : FreeInputTest
        With nothing added, with `found` added.
    """

    solution: Solution
    evidence: Evidence
    free: Ints
    found: Search[Evidence]
    before: FreeInputTest
    after: FreeInputTest

    @property
    def chosen(self) -> tuple[Candidate, ...]:
        """What this round chose."""
        p = len(self.evidence.weight)
        return tuple(self.evidence.candidates[i - p] for i in self.found.chosen)

    @property
    def suspect(self) -> bool:
        """Whether something is left, or suspiciously many terms were needed."""
        return self.after.p_value < UNEXPLAINED_P or len(self.found.chosen) >= _MANY


def settle(base: Solution, extra: Sequence[Effect], alpha: float, progress: Progress) -> Round:
    """Repeat looks until the choice stands.

    Parameters
    ----------
    base : Solution
        Calibration with the model as given; its last pass kept its matrices.
    extra : sequence of Effect
        The user's own effects, candidates like those of the catalogue.
    alpha : float
        False-alarm probability of a scan.
    progress : callable

    Returns
    -------
    Round
        The last one; its solution holds what it chose.
    """
    tried: tuple[Candidate, ...] = ()
    own = False
    for turn in range(MOST_ROUNDS):
        progress("candidates", 0.4 + 0.1 * turn)
        solution = base if not tried else with_effects(base, tried, progress)
        look = take(base, solution, tried, extra, alpha, own)
        if look.suspect and not own:
            progress("equations", 0.45 + 0.1 * turn)
            wide = take(base, solution, tried, extra, alpha, own=True)
            if prefer(wide, look):
                look, own = wide, True
        if {c.label for c in look.chosen} == {c.label for c in tried}:
            break
        tried = look.chosen
    return drop_companions(base, look, progress)


def drop_companions(base: Solution, look: Round, progress: Progress) -> Round:
    """Calibrate with what was chosen; drop the weakest below three of its sigmas, one at a time."""
    small: set[str] = set()
    while True:
        chosen = look.chosen
        solution = with_effects(base, chosen, progress) if chosen else base
        last, p = solution.last, len(look.evidence.weight)
        size = np.abs(last.estimate[p:]) / np.sqrt(np.diag(last.covariance)[p:])
        keep = np.ones(len(size), dtype=bool)
        if len(size) and size.min() < LEAST_SIGMAS:
            weakest = int(np.argmin(size))
            keep[weakest] = False
            small.add(chosen[weakest].label)
        kept = look.found.chosen[keep]
        look = replace(look, solution=solution, found=replace(look.found, chosen=kept))
        if keep.all():
            steps = mark_dropped(look.found.steps, {c.label for c in look.chosen}, small)
            found = replace(look.found, steps=steps)
            return replace(look, found=found, after=left(look.evidence, kept, look.free, look.found.scale))


def mark_dropped(steps: Sequence[Step], kept: set[str], small: set[str]) -> tuple[Step, ...]:
    """Mark the steps that are not among what was found, by their labels, with why; `small` were too small once in."""
    weak = f"calibrated with it, it is below {LEAST_SIGMAS:.0f} of its sigmas"
    gone = "what else was added explains the same better"
    return tuple(
        s if not s.accepted or s.label in kept else replace(s, taken_out=weak if s.label in small else gone)
        for s in steps
    )


def prefer(wide: Round, look: Round) -> bool:
    """Whether equations tell more than the catalogue.

    They do when they leave less by more than chance, or as little with fewer terms.
    """
    chance = 3.0 * np.sqrt(2.0 * look.after.dof)
    fewer = 0 < len(wide.found.chosen) < len(look.found.chosen)
    if len(wide.found.chosen) > max(1, len(look.found.chosen)) and look.after.p_value > UNEXPLAINED_P:
        return False
    return bool(wide.after.chi2 < look.after.chi2 - chance or (fewer and wide.after.chi2 < look.after.chi2 + chance))


def with_effects(base: Solution, added: Sequence[Candidate], progress: Progress) -> Solution:
    """Calibrate with more effects in the model."""
    setup = base.setup
    sensors = build([*setup.sensors.effects, *(c.effect for c in added)], setup.imu)
    return solve(replace(setup, sensors=sensors), base.prepared, progress, keep=True)


def take(
    base: Solution, solution: Solution, tried: Sequence[Candidate], extra: Sequence[Effect], alpha: float, own: bool
) -> Round:
    """Collect the evidence about a solution, with what it tried as candidates, and search it."""
    times = timetable(base.prepared)
    in_model = {label for effect in base.setup.sensors.effects for label in effect.labels}
    has_temperature = base.prepared.temperature is not None
    known = _untried([*extra, *catalogue(times, in_model, has_temperature)], tried, in_model)
    more = _untried([*equations(has_temperature), *periodic(times.duration)], tried, in_model) if own else []
    free = free_inputs(times)
    about = collect(base.prepared, solution.setup, solution.last, [*known, *more, *free])
    evidence = forget(about, len(in_model), tried)
    count = len(evidence.names) - sum(len(effect.parameters) for effect in free)
    columns = np.arange(len(evidence.weight), count)
    free_columns = np.arange(count, len(evidence.names))
    found = search(evidence, columns, alpha)
    nothing = np.empty(0, dtype=np.int64)
    evidence = found.evidence
    return Round(
        solution, evidence, free_columns, found,
        left(evidence, nothing, free_columns, found.scale), left(evidence, found.chosen, free_columns, found.scale),
    )  # fmt: skip


def forget(about: Evidence, p: int, tried: Sequence[Candidate]) -> Evidence:
    """Make candidates of the coefficients behind the first `p`: as if the calibration had not known them.

    The innovations are those of a model that has them at their estimates; in the linear model they were larger by the
    signature times the estimate without.
    """
    q = len(about.weight)
    if q == p:
        return about
    estimate = -about.shift[p:]
    # Not the prior that the calibration had: it was widened where the data contradicted it.
    stated = about.stated[p:q]
    return replace(
        about, e=about.e + about.W[:, p:q] @ estimate, weight=about.weight[:p], shift=about.shift[:p],
        stated=about.stated[:p],
        names=(*about.names[:p], *(c.label for c in tried), *about.names[q:]),
        candidates=(*tried, *about.candidates), prior=np.concatenate([stated, about.prior]),
    )  # fmt: skip


def left(evidence: Evidence, chosen: Ints, free: Ints, scale: float) -> FreeInputTest:
    """Free-input remainder with the chosen columns in the model."""
    known = np.concatenate([evidence.model, chosen]).astype(np.int64)
    weight = np.concatenate([evidence.weight, np.zeros(len(chosen))])
    return free_input_test(evidence.information, known, weight, free, scale)


def _untried(effects: Sequence[Effect], tried: Sequence[Candidate], in_model: set[str]) -> list[Effect]:
    """Effects without the parameters that the model has or that were tried in the same variant."""
    labels = {c.label for c in tried}
    out = []
    for effect in effects:
        names = tuple(
            c.parameter.name for c in split(effect) if c.label not in labels and c.label not in in_model
        )
        if names:
            out.append(effect.only(names) if len(names) < len(effect.parameters) else effect)
    return out
