"""Coefficients that depend on a choice that the data cannot make: they differ between the members of a class."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.diagnosis.problem import Problem
from sdimu_calibration.core.effects import bias
from sdimu_calibration.core.evidence.linear import E

MATTERS = 3.0
"""Difference of a coefficient (sigma) from which the choice matters: with less it is right enough whichever member it
is."""


@dataclass(frozen=True)
class CoefficientShift:
    """The coefficient that differs most when another member of the class takes the place of the one that was named."""

    other: str
    """Label of the other member."""
    coefficient: str
    sigmas: float
    """Estimate with the other less estimate with the one that was named, in sigmas of the latter."""


def coefficient_shifts(
    problem: Problem[E], chosen: Sequence[int], column: int, others: Sequence[int]
) -> tuple[CoefficientShift, ...]:
    """Exchange a chosen effect for every other member of its class and see what moves.

    Both are least-squares estimates of the linear model about the calibration, priors included.

    Parameters
    ----------
    chosen : sequence of int
        Columns of everything that was found.
    column : int
        The one of them that is exchanged.
    others : sequence of int
        Columns that the data cannot tell from it.

    Returns
    -------
    tuple of CoefficientShift
        One for each member that moves a coefficient of the model by more than three of its sigmas.
    """
    p = problem.evidence.coefficients
    names = problem.evidence.names
    known, weight, _ = problem.known(chosen)
    named, covariance = problem.evidence.information.estimate(known, weight)
    sigma = np.sqrt(np.diag(covariance)[:p])
    out = []
    for other in others:
        known, weight, _ = problem.known([other if c == column else c for c in chosen])
        estimate, _ = problem.evidence.information.estimate(known, weight)
        moved = (estimate - named)[:p] / sigma
        moved[_centred(problem, column, other)] = 0.0
        most = int(np.argmax(np.abs(moved)))
        if abs(moved[most]) > MATTERS:
            out.append(CoefficientShift(names[other], names[known[most]], float(moved[most])))
    return tuple(out)


def _centred(problem: Problem[E], column: int, other: int) -> list[int]:
    """Places of biases that are stated in the mean over the test: which of two drifts it is does not move them."""
    drifts = [problem.candidate(c).effect for c in (column, other) if problem.candidate(c).effect.bias_drift]
    biases = {bias.NAMES[term.channel] for effect in drifts for term in effect.terms}
    return [k for k, name in enumerate(problem.evidence.names[: problem.evidence.coefficients]) if name in biases]
