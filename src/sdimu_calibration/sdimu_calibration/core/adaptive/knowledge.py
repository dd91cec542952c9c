"""What a test knows at a stop: the fit, the sigmas that it reached, and the classes that its data leave open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.adaptive.goals import Goals
from sdimu_calibration.core.adaptive.open_class import OpenClass, separation
from sdimu_calibration.core.adaptive.so_far import SoFar, so_far
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.found import DECIDED, looked_at
from sdimu_calibration.core.diagnosis.problem import Problem, look_alikes
from sdimu_calibration.core.effects import body_frame
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.effects.gyro_rate_nonlinearity import SCALE_ASYMMETRY
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.evidence.candidate import Candidate
from sdimu_calibration.core.evidence.information import conditioned
from sdimu_calibration.core.evidence.testable import INDISTINGUISHABLE
from sdimu_calibration.core.plan_search.next_turn import named_class
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.core.wording import Option

_MOST_ALIKE = 6
"""Number of look-alikes of a class that are simulated: those nearest to the one that was found."""
_ROOM = 30.0
"""Prior of a candidate over the size that physics gives it (1): so wide that the data decide its size."""
CLEAR = 2.0
"""Difference of log Bayes factors (1) beyond the one that tells two candidates apart: what noise may take back."""


@dataclass(frozen=True)
class Knowledge:
    """What a test knows at a stop."""

    at: SoFar
    limited: tuple[str, ...]
    """Coefficients with a limit, length c."""
    ratio: Floats
    """Shape (c,). Sigma of every coefficient with a limit over that limit, in the noise of the fit (1); with what
    asymmetries may hide where the goals ask for both senses."""
    noise: Floats
    """Sigma in the noise of the fit over that in white noise (1), shape (c,)."""
    open: OpenClass | None
    """The class to be told apart, by the data or else by the goals; None where none is open."""
    named: tuple[str, ...]
    """Labels of everything that was found."""
    verdict: Verdict
    decided: tuple[str, ...] = ()
    """Of `named` those of a family that is sure to be missing, each by itself."""


def knowledge(found: Diagnosis, goals: Goals) -> Knowledge:
    """Take from a diagnosis what the choice of the next move needs. `found`: of what was recorded so far."""
    alike, sizes, needed, place = _class(found)
    named = tuple(c.label for c in found.chosen)
    known = fitted(found.extended, goals, tuple(c.effect for c in alike), named)
    known = replace(known, decided=_decided(found))
    if not alike:
        return replace(known, verdict=found.verdict)
    count = known.at.own
    columns = (count - len(named) + place, *range(count, count + len(alike)))
    one = OpenClass(named[place], tuple(c.label for c in alike), columns, sizes, needed)
    return replace(known, open=one, verdict=found.verdict)


def _decided(found: Diagnosis) -> tuple[str, ...]:
    """Labels of effects of the catalogue that are sure to be missing, each by itself; none where more is missing."""
    if found.verdict not in {Verdict.ONE_EFFECT, Verdict.SEVERAL_EFFECTS}:
        return ()
    of_unit = [one for one in found.found_effects if one.candidate.effect.scope != "recording"]
    return tuple(one.candidate.label for one in of_unit if one.of_family >= DECIDED and not one.alike)


def fitted(fit: Fit, goals: Goals, alike: Sequence[Effect] = (), named: tuple[str, ...] = ()) -> Knowledge:
    """Take from a fit alone what the choice of the next move needs: nothing stands out of its noise.

    `alike`: candidates that are estimated along in `Knowledge.at`; `named`: labels of what the model of the fit has
    beyond the one that was given.
    """
    if not isinstance(fit, NavigationFit):
        why = fit.test.why_handheld
        do = f"let the table run a plan instead ({why})" if why else f"choose another {Option.ESTIMATOR}"
        raise DataError(f"a {fit.estimator} fit says nothing of the next turn of a table: {do}")
    along = alike or _to_tell(fit, goals)
    at = so_far(fit, along, _ROOM, _hiding(fit, along) if goals.both_senses else ())
    limited, limit = goals.of(fit.names, fit.model.body_frame)
    # The doubt about the model is no noise: what is too small to be found stays so, however long a test is.
    ratio = np.sqrt(np.diag(fit.with_doubt(None).covariance)[limited]) / limit
    count = at.own
    # Beyond the model all is known, or the class alone: the ratio of both is what asymmetries may hide.
    of_class = sum(len(effect.parameters) for effect in along)
    white = ratios(at, goals, _known(at.covariance, count, len(at.names)))
    unseen = ratios(at, goals, _known(at.covariance, count, count + of_class)) / white
    names = tuple(name for name, has in zip(fit.names, limited, strict=True) if has)
    aim = None if alike else _aim(at, goals)
    return Knowledge(at, names, ratio * unseen, np.maximum(ratio / white, 1.0), aim, named, Verdict.CONSISTENT)


def _to_tell(fit: Fit, goals: Goals) -> tuple[Effect, ...]:
    """Find what the goals ask to tell apart, as far as the model has it not."""
    effects = named_class(goals.tell)[0] if goals.tell else []
    left = [(e, tuple(p.name for p in e.parameters if p.name not in fit.names)) for e in effects]
    return tuple(e if len(names) == len(e.parameters) else e.only(names) for e, names in left if names)


def _aim(at: SoFar, goals: Goals) -> OpenClass | None:
    """Class that the goals ask to tell apart: the first from all others, each of the size that physics gives it.

    None where that would be told by now.
    """
    if not goals.tell:
        return None
    names, prior = named_class(goals.tell)[1], at.setup.sensors.prior
    columns = tuple(at.names.index(name) for name in names)
    size = np.array([prior[c] / (1.0 if c < at.own else _ROOM) for c in columns])
    one = OpenClass(names[0], names[1:], columns, size, np.zeros(len(names) - 1))
    needed = INDISTINGUISHABLE + CLEAR - separation(one, prior, at.covariance[None])[0]
    return replace(one, needed=needed) if (needed > 0.0).any() else None


def _hiding(fit: Fit, alike: Sequence[Effect]) -> tuple[Effect, ...]:
    """Asymmetries of gyros' scale factors, as far as neither the model nor the class has them.

    Turns in one sense leave an asymmetry to the scale factor, and nothing of it stands out for a search to find.
    """
    has = {*fit.names, *(p.name for effect in alike for p in effect.parameters)}
    left = tuple(p.name for p in SCALE_ASYMMETRY.parameters if p.name not in has)
    return (SCALE_ASYMMETRY.only(left),) if left else ()


def _known(covariance: Floats, begin: int, end: int) -> Floats:
    """Covariance (p, p) where the coefficients from `begin` to `end` are known."""
    return conditioned(covariance, np.arange(begin, end)) if end > begin else covariance


def ratios(at: SoFar, goals: Goals, covariance: Floats) -> Floats:
    """Sigma over limit in white noise (dimensionless), shape (..., c).

    Parameters
    ----------
    covariance : ndarray, shape (..., p, p)
        Of its parameters (SI).
    """
    frame = at.setup.model.body_frame
    limited, limit = goals.of(at.names[: at.own], frame)
    J = body_frame.frame_jacobian(at.names, frame)[: at.own][limited] / limit[:, None]
    return np.asarray(np.sqrt(np.einsum("ci,...ij,cj->...c", J, covariance, J)))


def nearest_other(found: Diagnosis) -> float | None:
    """Difference of log Bayes factors between the first effect that was found and the next likely one.

    Time constants of the same effect are no other one.

    None where nothing was found, or nothing else can be seen.
    """
    chosen = found.found.chosen.tolist()
    if not chosen:
        return None
    problem = Problem(found.evidence)
    name = problem.candidate(chosen[0]).parameter.name
    scores = problem.scores(problem.scan(chosen[1:]))
    others = [i for i in looked_at(found) if problem.candidate(int(i)).parameter.name != name and i not in chosen]
    best = float(np.max(scores[others], initial=-np.inf))
    return float(scores[chosen[0]]) - best if np.isfinite(best) else None


def _class(found: Diagnosis) -> tuple[tuple[Candidate, ...], Floats, Floats, int]:
    """Look-alikes of the first class that is open, with sizes, what is lacking, and the place of the class."""
    problem = Problem(found.evidence)
    chosen, allowed = found.found.chosen.tolist(), looked_at(found)
    for place, column in enumerate(chosen):
        name = problem.candidate(column).parameter.name
        near = [
            i for i in look_alikes(problem, chosen, column, allowed) if problem.candidate(i).parameter.name != name
        ][:_MOST_ALIKE]
        if not near:
            continue
        others = [c for c in chosen if c != column]
        scanned = problem.scan(others)
        scores = problem.scores(scanned)
        needed = INDISTINGUISHABLE + CLEAR - (scores[column] - scores[near])
        return tuple(problem.candidate(i) for i in near), scanned.estimate[[column, *near]], needed, place
    return (), np.empty(0), np.empty(0), 0
