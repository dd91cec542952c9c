"""What was found, one effect at a time: size, score and share of the misfit of each, given those before it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.diagnosis.averaged import widened_by
from sdimu_calibration.core.diagnosis.coefficient_shifts import CoefficientShift, coefficient_shifts
from sdimu_calibration.core.diagnosis.free_input_test import free_input_test
from sdimu_calibration.core.diagnosis.ladder import error_ladder
from sdimu_calibration.core.diagnosis.problem import Problem
from sdimu_calibration.core.diagnosis.scan import scan
from sdimu_calibration.core.evidence.candidate import Candidate
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.evidence.testable import WORST_SENSOR
from sdimu_calibration.core.posterior.board import Board
from sdimu_calibration.core.posterior.detectable import told_from
from sdimu_calibration.core.posterior.told import Share
from sdimu_calibration.core.probability import normal_tail

if TYPE_CHECKING:
    from sdimu_calibration.core.diagnosis.diagnose import Diagnosis

TOLD_AS = "as itself, or among those that look the same"
"""How an effect of the size in `DetectableSize` is told."""
DECIDED = 0.95
"""Probability of a family (1) from which a member of it is advised to be kept: one in twenty is wrong then."""


@dataclass(frozen=True)
class Found:
    """One effect that was found.

    Attributes
    ----------
    value, sigma : float
        SI; of the refit where the calibration was repeated with it, else with all others of the search in.
    z : float
        Score when those found before it are in the model and those after it are not.
    p_value_adjusted : float
        Of `z`, times the number of candidates that were looked at.
    explained : float
        Share of the free-input misfit of the model as given that this effect removes.
    held_out_before, held_out_after : float
        `error_figures.held_out` without it and with it; NaN where no model with so many effects was fitted.
    alike : tuple of str
        Candidates that the data cannot tell from it, all others found being in the model.
    coefficient_shifts : tuple of CoefficientShift
        Coefficients of the model that hang on which of these it is.
    probability : float
        That it or something of its class is missing in the model; NaN where no probabilities were worked out.
    may_be : tuple of Share
        Coefficients of that class with the probability of each, the likeliest first.
    together : tuple of (str, str, float)
        Labels of two effects that together show as this one does, to rounding, and the probability that both are
        there.
    widened : tuple of (str, float)
        Coefficients with their sigma over that if it were known to be this effect, as of `widened_by`.
    of_family : float
        Probability that its family is missing on its sensor, as often as it is told there; NaN where no probabilities
        were worked out.
    """

    candidate: Candidate
    value: float
    sigma: float
    z: float
    log_likelihood_gain: float
    log_bayes_factor: float
    p_value_adjusted: float
    explained: float
    held_out_before: float
    held_out_after: float
    alike: tuple[str, ...]
    coefficient_shifts: tuple[CoefficientShift, ...]
    probability: float = float("nan")
    may_be: tuple[Share, ...] = ()
    of_family: float = float("nan")
    together: tuple[tuple[str, str, float], ...] = ()
    widened: tuple[tuple[str, float], ...] = ()

    @property
    def decided(self) -> bool:
        """Whether it is sure that something of its family is missing."""
        return not self.of_family < DECIDED


def found_effects(d: Diagnosis) -> tuple[Found, ...]:
    """Take the search's result apart, in its order.

    Returns
    -------
    tuple of Found
        Empty when nothing was chosen. Also what was chosen on the way to ``unexplained``.
    """
    problem = Problem(d.evidence)
    chosen = [int(i) for i in d.found.chosen]
    misfit = _misfits(d, problem, chosen)
    whole = max(misfit[0], 1e-9) if misfit else 1.0
    values, sigmas = _estimates(d, problem, chosen)
    allowed = looked_at(d)
    held_out, wider = _held_out(d, len(chosen)), _widened(d, chosen)
    out = []
    for k, column in enumerate(chosen):
        scanned = problem.scan(chosen[:k])
        scores = problem.scores(scanned)
        z = float(scanned.z[column])
        count = int(np.isfinite(scanned.sigma[allowed]).sum()) + d.found.passed
        probability, shares = d.may_be(column)
        out.append(
            Found(
                candidate=d.chosen[k],
                value=float(values[k]),
                sigma=float(sigmas[k]),
                z=z,
                log_likelihood_gain=0.5 * z * z,
                log_bayes_factor=_bayes(d, k, float(scores[column])),
                p_value_adjusted=float(min(1.0, count * 2.0 * normal_tail(abs(z)))),
                explained=float(np.clip((misfit[k] - misfit[k + 1]) / whole, 0.0, 1.0)),
                held_out_before=held_out[k],
                held_out_after=held_out[k + 1],
                alike=d.found.alike(k),
                coefficient_shifts=coefficient_shifts(problem, chosen, column, d.found.columns_alike(k)),
                probability=probability,
                may_be=shares,
                of_family=_of_family(d, column),
                together=_together(d, column),
                widened=wider.get(column, ()),
            )
        )
    return tuple(out)


def _together(d: Diagnosis, column: int) -> tuple[tuple[str, str, float], ...]:
    """Pairs of effects that show as a chosen column does, each with its probability."""
    window = d.found.posterior
    if window is None:
        return ()
    pairs = window.together(window.place_of(column))
    return tuple((window.candidate(one).label, window.candidate(other).label, p) for one, other, p in pairs)


def _widened(d: Diagnosis, chosen: list[int]) -> dict[int, tuple[tuple[str, float], ...]]:
    """Coefficients that are known less well because the class of a chosen column is open, with the ratio of sigmas."""
    window = d.found.posterior
    return {} if window is None else widened_by(d.fit, window, (k for k in chosen if len(d.may_be(k)[1]) > 1))


def _of_family(d: Diagnosis, column: int) -> float:
    """Probability of the family of a chosen column; NaN where no probabilities were worked out."""
    window = d.found.posterior
    if d.probabilities is None or window is None:
        return float("nan")
    return window.of_family(window.place_of(column))


def _held_out(d: Diagnosis, count: int) -> list[float]:
    """Held-out error with none, the first, the first two ... of what was found."""
    known = [error for _, error in error_ladder(d)]
    return known if len(known) == count + 1 else [known[0], *[float("nan")] * (count - 1), known[-1]]


def _bayes(d: Diagnosis, k: int, linear: float) -> float:
    """Log Bayes factor of the k-th found effect: of two refits where they were made, else of the linear model."""
    return d.rungs[k + 1].log_bayes_factor if d.fit.learns_scatter else linear


def looked_at(d: Diagnosis) -> Ints:
    """Columns of the evidence that the search was allowed to choose: all candidates but the free inputs.

    Returns
    -------
    ndarray of int, shape (c,)
        In ascending order.
    """
    return np.setdiff1d(np.arange(len(d.evidence.weight), len(d.evidence.names)), d.free)


def catalogue_columns(d: Diagnosis) -> Ints:
    """Columns of the evidence that hold effects of the catalogue or of the user, and no equations.

    Returns
    -------
    ndarray of int, shape (c,)
        In ascending order.
    """
    return np.array([i for i in looked_at(d) if d.evidence.candidate(i).family != "own"], dtype=np.int64)


@dataclass(frozen=True)
class DetectableSize:
    """What this test could have seen of one effect that the model does not have."""

    label: str
    family: str
    unit: str
    display_unit: str
    smallest: float
    """Size that is told in 80 % of tests, as itself or as one of those that look the same (SI), as of `told_from`; inf
    when none is."""
    retention: float
    """Share of its signature that the model's coefficients leave."""
    testable: bool
    """A size that a sensor may have would have been found."""
    partners: tuple[str, ...] = ()
    """Coefficients of the model that take the rest; given when it is not testable."""
    sigma: float = float("inf")
    """Of its size beside the model (SI); inf when the model takes all of it."""
    prior: float = float("inf")
    """One-sigma size that physics gives it (SI); inf where unknown."""


def reach(d: Diagnosis) -> tuple[DetectableSize, ...]:
    """Minimal detectable size of every candidate of the catalogue, given the model that was asked about."""
    evidence = d.evidence.only(catalogue_columns(d))
    p = len(evidence.weight)
    full = evidence.information
    scanned = scan(full, evidence.model, evidence.weight)
    size = _told_from(d)
    out = []
    for k, candidate in enumerate(evidence.candidates, start=p):
        smallest = size.get(candidate.label, float("inf"))
        testable = bool(np.isfinite(scanned.sigma[k]) and smallest <= WORST_SENSOR * evidence.prior[k - p])
        partners = () if testable else _partners(evidence.names, full.J, evidence.weight, k)
        out.append(
            DetectableSize(
                candidate.label,
                candidate.family,
                candidate.parameter.unit,
                candidate.parameter.display_unit,
                smallest,
                float(scanned.retention[k]),
                testable,
                partners,
                float(scanned.sigma[k]),
                float(evidence.prior[k - p]),
            )
        )
    return tuple(out)


def _told_from(d: Diagnosis) -> dict[str, float]:
    """Size from which each candidate is told in most tests (SI), by label; without those that no search looks at."""
    window = d.found.posterior
    board: Board[Any] = Board(d.evidence, looked_at(d), frozenset(), None) if window is None else window.board
    scores = told_from(board, () if window is None else d.found.noise)
    return {board.evidence.candidate(column).label: size for column, size in scores.size.items()}


def _partners(names: tuple[str, ...], J: Floats, weight: Floats, column: int) -> tuple[str, ...]:
    """Name the coefficients that take most of the signature at a column, at most three; J (q, q), prior weight (p,)."""
    p = len(weight)
    if J[column, column] <= 0.0:
        return ()
    unit = 1.0 / np.sqrt(np.diag(J)[:p] + weight)
    A = (J[:p, :p] + np.diag(weight)) * np.outer(unit, unit)
    share = np.linalg.solve(A, unit * J[:p, column]) * (unit * J[:p, column]) / J[column, column]
    return tuple(names[i] for i in np.argsort(-share)[:3] if share[i] > 0.05)


def _misfits(d: Diagnosis, problem: Problem[LinearEvidence], chosen: list[int]) -> list[float]:
    """Misfit with none, one, two ... of the chosen in the model.

    Free-input chi-square beyond its degrees of freedom; chi-square of the residuals where no free inputs are testable.
    """
    out = []
    for k in range(len(chosen) + 1):
        known, weight, _ = problem.known(chosen[:k])
        if len(d.free):
            left = free_input_test(d.evidence.information, known, weight, d.free)
            out.append(max(left.chi2 - left.dof, 0.0))
        else:
            estimate, _ = problem.evidence.information.estimate(known, weight)
            residual = problem.evidence.e - problem.evidence.W[:, known] @ estimate
            out.append(float(residual @ residual))
    return out if len(d.free) else [value - out[-1] for value in out]


def _estimates(d: Diagnosis, problem: Problem[LinearEvidence], chosen: list[int]) -> tuple[Floats, Floats]:
    """Value and sigma of each, of the refit where there is one."""
    known, weight, _ = problem.known(chosen)
    estimate, covariance = d.evidence.information.estimate(known, weight)
    p = len(d.evidence.weight)
    values, sigmas = estimate[p:].copy(), np.sqrt(np.diag(covariance))[p:]
    if d.extended is not d.fit:
        last = slice(len(d.after.names) - len(chosen), None)
        return d.after.values[last], np.sqrt(np.diag(d.after.covariance)[last])
    return values, sigmas
