"""What follows when an effect is added to a model: what it would take, what looks the same, what speaks against it.

A person who decides alone sees this before the fit (`addition`, linear) and after it (`objections`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.advice import Advice, Kind, Verb
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.diagnosis.advice import NOT_BY_HAND, in_catalogue, reason, telling_stay
from sdimu_calibration.core.diagnosis.found import DetectableSize
from sdimu_calibration.core.diagnosis.plan_seen import plan_seen
from sdimu_calibration.core.diagnosis.problem import Problem, look_alikes
from sdimu_calibration.core.effects.effect import Excitation
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.evidence.candidate import Candidate
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.evidence.navigation_evidence import NavigationEvidence
from sdimu_calibration.core.evidence.testable import TESTABLE
from sdimu_calibration.core.results import Calibration

RAISED = 10.0
"""Ratio (1) of a coefficient's sigma with an addition to that without: from there the data do not tell them apart."""
_CONTRADICTED = 4.5
"""Size of an added coefficient (sigma of what physics gives it) from which it is contradicted: chance puts one in 150
000 there."""
_FALLS = 1e-4
"""Share (1) by which an error must fall: less is the rounding of the passes."""
LEAST_SIGMAS = 3.0
"""Size of an effect in the fit (sigma) below which nothing says that it is there: chance ends there."""
_MOST = 5
"""Number of look-alikes that are named: more do not fit into a line."""


@dataclass(frozen=True)
class Addition:
    """What the linear model says of an effect that is not added yet."""

    labels: tuple[str, ...]
    """Its parameters, length k."""
    columns: Ints
    """Where they stand in the evidence, shape (k,)."""
    estimate: Floats
    sigma: Floats
    """`estimate`, `sigma`: SI, shape (k,)."""
    held_out: tuple[float, float]
    """Error at stops left out one by one (sigma), without it and with it."""
    raised: float
    """How many times it raises the sigma of the coefficient that suffers most."""
    alike: tuple[str, ...]
    """What the data cannot tell from its first parameter."""
    tells: Advice | None
    """What would tell them apart; None where nothing looks the same."""
    objections: tuple[str, ...]
    """What speaks against it, one line each."""


def addition(fit: Fit, evidence: LinearEvidence, columns: Sequence[int], allowed: Ints) -> Addition:
    """Work out what follows when candidates of the evidence about a fit are added together.

    Parameters
    ----------
    columns : sequence of int, length k
        The candidates.
    allowed : ndarray of int, shape (a,)
        Columns among which look-alikes are sought.
    """
    problem, p, q = Problem(evidence), len(evidence.weight), evidence.coefficients
    chosen = [int(c) for c in columns]
    known, weight, _ = problem.known(chosen)
    estimate, covariance = evidence.information.estimate(known, weight)
    bare = evidence.information.estimate(evidence.model, evidence.weight)[1]
    before, after = (np.sqrt(np.diag(fit.reported_covariance(C[:q, :q]))) for C in (bare, covariance))
    labels = tuple(evidence.names[c] for c in chosen)
    sigma = np.sqrt(np.diag(covariance))[p:]
    error = (problem.held_out([]).rms, problem.held_out(chosen).rms)
    raised = _raised(fit.names, before, after)
    retention = problem.scan([]).retention
    hidden = [k for k in chosen if not retention[k] > TESTABLE]
    others = [] if chosen[0] in hidden else look_alikes(problem, chosen, chosen[0], allowed)
    alike = tuple(evidence.names[k] for k in others if k not in chosen)[:_MOST]
    taken = "cannot be told from the coefficients of the model"
    against = [f"{evidence.names[k]} {taken}: {_why(evidence, k)}" for k in hidden]
    against += _against(labels, estimate[p:], sigma, evidence.prior[np.array(chosen) - p], raised, error)
    tells = _telling(problem.candidate(chosen[0]), alike, evidence)
    return Addition(
        labels, np.array(chosen, dtype=np.int64), estimate[p:], sigma, error, raised[1], alike, tells, tuple(against)
    )


def _telling(one: Candidate, alike: Sequence[str], evidence: LinearEvidence) -> Advice | None:
    """Say what would tell a candidate from the first that looks the same: turns that are ranked, or a stay."""
    if not alike or not isinstance(evidence, NavigationEvidence):
        return None
    lasting = Excitation.REPEATED_ATTITUDES not in one.effect.excitation
    if lasting and all(map(in_catalogue, names := (one.label, alike[0]))):
        return Advice(Kind.RANK_TURNS, (), Verb.RANK_TURNS, names)
    return telling_stay(one.effect, plan_seen(evidence))


def objections(
    earlier: Calibration, later: Calibration, prior: Floats, held_out: tuple[float, float]
) -> tuple[str, ...]:
    """Say what speaks against the effect by which two fits to the same measurements differ, one line each.

    Parameters
    ----------
    earlier, later : Calibration
        Without the effect, and with it: its parameters come last.
    prior : ndarray, shape (p,)
        One-sigma (SI) that physics gives the coefficients of the later one.
    held_out : tuple of (float, float)
        Error at stops left out (sigma), of both.
    """
    at = [later.names.index(name) for name in earlier.names if name in later.names]
    same = [k for k, name in enumerate(earlier.names) if name in later.names]
    before, after = (np.sqrt(np.maximum(np.diag(c.covariance), 0.0)) for c in (earlier, later))
    raised = _raised([earlier.names[k] for k in same], before[same], after[at])
    new = [k for k in range(len(later.names)) if k not in at]
    labels = tuple(later.names[k] for k in new)
    return tuple(_against(labels, later.values[new], after[new], prior[new], raised, held_out))


def _raised(names: Sequence[str], before: Floats, after: Floats) -> tuple[str, float]:
    """Coefficient whose sigma grows most, and how many times."""
    ratio = np.divide(after, before, out=np.ones_like(after), where=before > 0.0)
    worst = int(np.argmax(ratio))
    return names[worst], float(ratio[worst])


def _against(
    labels: Sequence[str],
    value: Floats,
    sigma: Floats,
    prior: Floats,
    raised: tuple[str, float],
    held_out: tuple[float, float],
) -> list[str]:
    name, ratio = raised
    what = labels[0] if len(labels) == 1 else f"{labels[0]} and {len(labels) - 1} more"
    out = []
    if ratio > RAISED:
        out.append(f"{what} raises the sigma of {name} {ratio:.0f} times: the data do not tell them apart")
    z = np.abs(np.divide(value, sigma, out=np.zeros_like(value), where=sigma > 0.0))
    if len(z) and z.max() < LEAST_SIGMAS:
        out.append(f"{what} is {z.max():.1f} of its sigmas: nothing says that it is there")
    out += [
        f"{label} is {size:.0f} times what physics gives it: something else stands behind it"
        for label, size in zip(labels, np.abs(value) / prior, strict=True)
        if size > _CONTRADICTED
    ]
    if held_out[1] > (1.0 - _FALLS) * held_out[0]:
        out.append(f"{what} does not lower the error at stops that the fit has not seen")
    return out


def _why(evidence: LinearEvidence, column: int) -> str:
    """Reason why a candidate does not show."""
    candidate = evidence.candidates[column - len(evidence.weight)]
    if not isinstance(evidence, NavigationEvidence):
        return NOT_BY_HAND
    parameter = candidate.parameter
    size = DetectableSize(
        candidate.label,
        candidate.family,
        parameter.unit,
        parameter.display_unit,
        float("inf"),
        0.0,
        testable=False,
        partners=("model",),
    )
    return reason(size, plan_seen(evidence)).text
