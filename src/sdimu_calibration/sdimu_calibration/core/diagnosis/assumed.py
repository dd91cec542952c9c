"""What each coefficient takes for granted: that an effect is absent which the test shows weakly.

At +-1 g a scale factor and K3 of an accelerometer are one; a prior says which it is, and the data hardly. If the effect
is there after all, the coefficient is many of its sigmas off, and no residual shows it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.coefficient_shifts import MATTERS
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.found import catalogue_columns
from sdimu_calibration.core.diagnosis.problem import Problem
from sdimu_calibration.core.evidence.information import solved
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.evidence.testable import TESTABLE
from sdimu_calibration.core.posterior.coefficients import drift_mean


@dataclass(frozen=True)
class Assumed:
    """An effect that a coefficient takes to be absent."""

    coefficient: str
    label: str
    family: str
    """`label`, `family`: of the effect: that of all which moves the coefficient most."""
    size: float
    """Size of the effect, if it is there: root mean square of what prior and data leave (SI)."""
    unit: str
    display_unit: str
    sigmas: float
    """By how much the coefficient is off then (sigma)."""


def assumed_absent(d: Diagnosis) -> tuple[Assumed, ...]:
    """Name for each coefficient the effect that would move it most, of those that are not told.

    With the model's information A, its signature b and its prior size s an effect has the size ``m +- v^(1/2)``, where
    ``v = 1/(c + s^-2)``, ``m = v r``; ``c, r`` are its information and pull beside the model. One unit of it moves the
    parameters of the model by ``-A^-1 b``. A bias is that in the mean over the dwells, whatever drifts the model has.

    Returns
    -------
    tuple of Assumed
        One for each coefficient that is moved by more than three of the sigmas that the diagnosis states, the largest
        move first.
    """
    problem: Problem[LinearEvidence] = Problem(d.evidence)
    chosen = d.found.chosen.tolist()
    known, weight, _ = problem.known(chosen)
    columns, stated = _not_told(d), _stated_sigmas(d)
    if not columns:
        return ()
    J, right = d.evidence.information.J, d.evidence.information.d
    A, B = J[np.ix_(known, known)] + np.diag(weight), J[known][:, columns]
    X = solved(A, np.column_stack([B, right[known]]))
    across, estimate = X[:, : len(columns)], X[:, len(columns)]
    information = np.maximum(np.diag(J)[columns] - np.einsum("ik,ik->k", B, across), 0.0)
    prior = d.evidence.prior[np.array(columns) - problem.p]
    variance = 1.0 / (information + prior**-2.0)
    size = np.sqrt(variance + (variance * (right[columns] - B.T @ estimate)) ** 2)
    # In the mean over the dwells: what the parameters give up, the drifts of the model with it, and its own.
    parameters = np.column_stack([np.eye(len(stated), problem.p), _dwell_means(d, chosen)])
    moved = np.abs(_dwell_means(d, columns) - parameters @ across) * size / stated[:, None]
    worst = np.argmax(moved, axis=1)
    out = []
    for row in np.argsort(-moved.max(axis=1)).tolist():
        place = int(worst[row])
        if moved[row, place] > MATTERS:
            one = problem.candidate(columns[place])
            unit, shown = one.parameter.unit, one.parameter.display_unit
            own = (float(size[place]), unit, shown, float(moved[row, place]))
            out.append(Assumed(d.evidence.names[row], one.label, one.family, *own))
    return tuple(out)


def _not_told(d: Diagnosis) -> list[int]:
    """Columns of effects of a known size that are neither told nor what an effect that is told may be instead."""
    chosen, p = {*d.found.chosen.tolist(), *_of_another_name(d)}, len(d.evidence.weight)
    told = {label for one in d.found_effects for label in one.alike}
    told |= {share.name for one in d.found_effects for share in one.may_be}
    return [
        c
        for c in catalogue_columns(d).tolist()
        if c not in chosen
        and np.isfinite(d.evidence.prior[c - p])
        and not {d.evidence.candidates[c - p].label, d.evidence.candidates[c - p].coefficient} & told
    ]


def _of_another_name(d: Diagnosis) -> list[int]:
    """Columns that are a coefficient of the model by another name: a mass unbalance is a sensitivity to force."""
    full, effects = d.evidence.information, d.fit.sensors.effects
    J, _ = full.diagonal_given(d.evidence.model, d.evidence.weight)
    named = {effect.family or effect.name for effect in effects}
    inside = {effect.contained_in for effect in effects} - {""}
    out = []
    for column in catalogue_columns(d).tolist():
        candidate = d.evidence.candidate(column)
        same = candidate.family in inside or candidate.effect.contained_in in named
        if same and J[column] < TESTABLE**2 * full.J[column, column]:
            out.append(column)
    return out


def _stated_sigmas(d: Diagnosis) -> Floats:
    """Sigmas of the q coefficients as the diagnosis states them (SI); inf of what is fixed."""
    sigma = dict(zip(d.after.names, np.sqrt(np.diag(d.after.covariance)).tolist(), strict=True))
    names = d.evidence.names[: d.evidence.coefficients]
    return np.array([sigma.get(name, 0.0) or np.inf for name in names])


def _dwell_means(d: Diagnosis, columns: list[int]) -> Floats:
    """Mean over the dwells that one unit of each of k effects adds to each of q coefficients, shape (q, k)."""
    p, names = len(d.evidence.weight), d.evidence.names[: d.evidence.coefficients]
    means = [drift_mean(d.evidence.candidates[c - p].effect, d.fit.dwell_means, names) for c in columns]
    return np.array(means).reshape(-1, len(names)).T
