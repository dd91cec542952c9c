"""What each effect that was found adds to those before it: score, size, prediction of stops left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from sdimu_calibration.core.diagnosis.problem import Problem
from sdimu_calibration.core.diagnosis.scan import Scan
from sdimu_calibration.core.evidence.held_out import HeldOut, gain
from sdimu_calibration.core.evidence.linear import E


@dataclass(frozen=True)
class Step:
    """One rung of the ladder."""

    label: str
    family: str
    unit: str
    display_unit: str
    z: float
    threshold: float
    """`z`, `threshold`: score beside those before it, and what noise reaches."""
    estimate: float
    sigma: float
    """`estimate`, `sigma`: SI, with everything chosen up to this step."""
    log_likelihood_gain: float
    log_bayes_factor: float
    held_out_before: HeldOut
    held_out_after: HeldOut
    held_out_gain: float
    held_out_error: float
    """`held_out_gain`, `held_out_error`: log score over all stops, and its standard error."""
    alike: tuple[str, ...]
    """Labels of candidates that the data cannot tell from it."""
    moved: tuple[tuple[str, float], ...] = field(default=())
    """Coefficients of the model that move most when it is added: value with it less value without, in their sigmas
    without it."""


def step_of(
    problem: Problem[E],
    scanned: Scan,
    chosen: Sequence[int],
    best: int,
    limit: float,
    before: HeldOut,
    after: HeldOut,
    alike: tuple[str, ...],
) -> Step:
    """Say what a column adds to a choice.

    Parameters
    ----------
    scanned : Scan
        With the choice in the model, the column not.
    chosen : sequence of int
        Columns of the choice.
    limit : float
        Threshold of the scan.
    before, after : HeldOut
        Prediction of stops left out without and with the column.
    alike : tuple of str
        Labels of its class: what the data cannot tell from it.
    """
    evidence, p = problem.evidence, problem.p
    candidate = evidence.candidates[best - p]
    J, d = scanned.J[best], scanned.d[best]
    bayes = float(problem.scores(scanned)[best])
    # A fault of one turn is nowhere to be seen once the stop after it is left out; all others must gain by it.
    apart = int(candidate.effect.options["turn"]) if "turn" in candidate.effect.options else None
    won, error = gain(before, after, apart)
    return Step(
        label=candidate.label,
        family=candidate.family,
        unit=candidate.parameter.unit,
        display_unit=candidate.parameter.display_unit,
        z=float(scanned.z[best]),
        threshold=limit,
        estimate=float(scanned.estimate[best]),
        sigma=float(scanned.sigma[best]),
        log_likelihood_gain=0.5 * d * d / J,
        log_bayes_factor=bayes,
        held_out_before=before,
        held_out_after=after,
        held_out_gain=won,
        held_out_error=error,
        alike=alike,
        moved=_moved(problem, chosen, best, float(scanned.estimate[best])),
    )


def _moved(problem: Problem[E], chosen: Sequence[int], best: int, size: float) -> tuple[tuple[str, float], ...]:
    """Largest moves of coefficients when the effect is added: after less before, in their sigmas before."""
    known, weight, _ = problem.known(chosen)
    J = problem.evidence.information.J
    A = J[np.ix_(known, known)] + np.diag(weight)
    unit = 1.0 / np.sqrt(np.diag(A))
    inverse = np.linalg.inv(A * np.outer(unit, unit)) * np.outer(unit, unit)
    change = -inverse @ J[known, best] * size / np.sqrt(np.diag(inverse))
    # Neither attitudes nor the like, which only serve: coefficients of the model, and what was chosen before.
    told = [*range(problem.evidence.coefficients), *range(problem.p, len(known))]
    order = sorted(told, key=lambda i: -abs(change[i]))[:4]
    return tuple((problem.evidence.names[known[i]], float(change[i])) for i in order)
