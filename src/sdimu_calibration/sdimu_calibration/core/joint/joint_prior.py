"""What is known of the coefficients of a set before its data: the prior of the joint estimate, wider where it is wrong.

A recording that contradicts a prior by itself has widened it. What no recording alone can tell, all together can.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.effects.references import SITE_REFERENCES
from sdimu_calibration.core.filter.solution import ROOM, held_back
from sdimu_calibration.core.joint.member import Report
from sdimu_calibration.core.joint.scope import split_tag
from sdimu_calibration.core.joint.shared_function import is_weight


def prior_weight(reports: Sequence[Report], names: Sequence[str]) -> Floats:
    """Prior information of the coefficients: the least that a recording takes.

    Returns
    -------
    ndarray, shape (P,)
        1/SI^2.
    """
    least: dict[str, float] = {}
    for report in reports:
        for name, weight in zip(report.reduction.names, report.reduction.weight.tolist(), strict=True):
            least[name] = min(weight, least.get(name, np.inf))
    return np.array([least[name] for name in names])


def widened(weight: Floats, names: Sequence[str], estimate: Floats, covariance: Floats) -> Floats:
    """Widen priors that the joint estimate contradicts, by the rule of a single one; the same array when none is.

    What the site says of itself is taken at its word; misalignments and weights of a function keep their prior.

    Parameters
    ----------
    weight : ndarray, shape (P,)
        Prior information (1/SI^2).
    names : sequence of str, length P
        Coefficients.
    estimate, covariance : ndarray, shapes (P,) and (P, P)
        SI.

    Returns
    -------
    ndarray, shape (P,)
        1/SI^2.
    """
    held, data = held_back(weight, estimate, covariance)
    held &= ~_kept(names)
    if not held.any():
        return weight
    return np.where(held, (ROOM * np.abs(np.where(held, data, 1.0))) ** -2.0, weight)


def _kept(names: Sequence[str]) -> Bools:
    """Tell the coefficients whose prior stays: misalignments, references of the site, weights; shape (P,)."""
    effects = map(registry.get, registry.names())
    kept = {p.name for effect in effects if effect.gauge for p in effect.parameters}.union(SITE_REFERENCES)
    return np.array([split_tag(name)[0] in kept or is_weight(name) for name in names], dtype=bool)
