"""What each coefficient takes for granted: that an effect is absent which the test shows weakly.

At +-1 g a scale factor and K3 of an accelerometer are one; a prior says which it is, and the data hardly. If the effect
is there after all, the coefficient is many of its sigmas off, and no residual shows it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.found import catalogue_columns
from sdimu_calibration.core.diagnosis.problem import Problem
from sdimu_calibration.core.effects import bias
from sdimu_calibration.core.evidence.information import solved
from sdimu_calibration.core.evidence.linear import LinearEvidence

_MATTERS = 3.0
"""Move of a coefficient (sigma) from which it is told: less is within what its sigma says."""


@dataclass(frozen=True)
class Assumed:
    """An effect that a coefficient takes to be absent.

    Attributes
    ----------
    label, family : str
        Of the effect: that of all which moves the coefficient most.
    size : float
        Size of the effect, if it is there: root mean square of what prior and data leave (SI).
    sigmas : float
        By how much the coefficient is off then (sigma).
    """

    coefficient: str
    label: str
    family: str
    size: float
    unit: str
    display_unit: str
    sigmas: float


def assumed_absent(d: Diagnosis) -> tuple[Assumed, ...]:
    """Name for each coefficient the effect that would move it most, of those that are not in the model.

    With the model's information A, its signature b and its prior size s an effect has the size ``m +- v^(1/2)``, where
    ``v = 1/(c + s^-2)``, ``m = v r``; ``c, r`` are its information and pull beside the model. One unit of it moves the
    coefficients by ``-A^-1 b``.

    Returns
    -------
    tuple of Assumed
        One for each coefficient that is moved by more than three sigmas, the largest move first.
    """
    problem: Problem[LinearEvidence] = Problem(d.evidence)
    chosen = d.found.chosen.tolist()
    known, weight, _ = problem.known(chosen)
    prior = d.evidence.prior
    columns = [c for c in catalogue_columns(d).tolist() if c not in chosen and np.isfinite(prior[c - problem.p])]
    if not columns:
        return ()
    J, right = d.evidence.information.J, d.evidence.information.d
    A, B = J[np.ix_(known, known)] + np.diag(weight), J[np.ix_(known, columns)]
    X = solved(A, np.column_stack([B, right[known], np.eye(len(known))]))
    across, estimate, covariance = X[:, : len(columns)], X[:, len(columns)], X[:, len(columns) + 1 :]
    information = np.maximum(np.diag(J)[columns] - np.einsum("ik,ik->k", B, across), 0.0)
    variance = 1.0 / (information + prior[np.array(columns) - problem.p] ** -2.0)
    size = np.sqrt(variance + (variance * (right[columns] - B.T @ estimate)) ** 2)
    q = d.evidence.coefficients
    moved = np.abs(_unit_moves(d, columns, across[:q])) * size / np.sqrt(np.diag(covariance)[:q, None])
    worst = np.argmax(moved, axis=1)
    out = []
    for row in np.argsort(-moved.max(axis=1)).tolist():
        place = int(worst[row])
        if moved[row, place] > _MATTERS:
            one = problem.candidate(columns[place])
            unit, shown = one.parameter.unit, one.parameter.display_unit
            own = (float(size[place]), unit, shown, float(moved[row, place]))
            out.append(Assumed(d.evidence.names[row], one.label, one.family, *own))
    return tuple(out)


def _unit_moves(d: Diagnosis, columns: list[int], across: Floats) -> Floats:
    """Move of each of q coefficients per unit of each of k effects; a bias is that in the mean over the dwells.

    Parameters
    ----------
    across : ndarray, shape (q, k)
        What one unit of an effect takes off, were the coefficients constants.
    """
    out, p = -across, len(d.evidence.weight)
    rows = {name: row for row, name in enumerate(d.evidence.names[: d.evidence.coefficients])}
    for place, column in enumerate(columns):
        effect = d.evidence.candidates[column - p].effect
        if not effect.bias_drift:
            continue
        for mean, term in zip(d.fit.dwell_means(effect).tolist(), effect.terms, strict=True):
            name = bias.NAMES[term.channel]
            if name in rows:
                out[rows[name], place] += mean
    return out
