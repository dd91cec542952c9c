"""Everything that results of one type say together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effect_key import effect_of
from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.effects.effect import BASELINE
from sdimu_calibration.core.fleet.common import Bytes, CommonEffect, common_effects
from sdimu_calibration.core.fleet.population import Measured, Population, population, without_those_out
from sdimu_calibration.core.fleet.trends import Trend, trends


@dataclass(frozen=True)
class Candidates:
    """Candidate effects of units, each alone beside the model.

    Attributes
    ----------
    names, display_units : tuple of str, length k
    estimates, sigmas : ndarray, shape (m, k)
        SI, one row a unit; NaN where it does not know an effect.
    correlations : ndarray of int, shape (m, k, k)
        Of the estimates in each unit, times `common.STEPS`.
    """

    names: tuple[str, ...]
    display_units: tuple[str, ...]
    estimates: Floats
    sigmas: Floats
    correlations: Bytes


@dataclass(frozen=True)
class Study:
    """What results of one type say together.

    Attributes
    ----------
    inside : Population
        Without the units that are out: what priors and control limits are of.
    slopes : tuple of Trend
        Of the units that are not out.
    common : tuple of CommonEffect
        Effects beyond the baseline, smallest probability first.
    """

    fleet: Measured
    people: Population
    inside: Population
    slopes: tuple[Trend, ...]
    common: tuple[CommonEffect, ...]


def study(fleet: Measured, model: Sequence[str], candidates: Candidates) -> Study:
    """Study results of one type.

    Effects that are in the model beyond the baseline are candidates of the type, too.

    Parameters
    ----------
    model : sequence of str
        Effects that all results have.
    candidates : Candidates
        Of the diagnoses; empty without any.
    """
    people = population(fleet)
    left = without_those_out(fleet, people)
    inside = people if left is fleet else population(left)
    own = [one for one in people.coefficients if _beyond_baseline(effect_of(one.name, model))]
    found = common_effects(
        candidates.names, candidates.estimates, candidates.sigmas, correlations=candidates.correlations
    )
    if own:
        values, sigmas = np.array([one.values for one in own]).T, np.array([one.sigmas for one in own]).T
        modelled = common_effects([one.name for one in own], values, sigmas)
        found = (*modelled, *(one for one in found if one.name not in {m.name for m in modelled}))
    return Study(fleet, people, inside, trends(left), found)


def _beyond_baseline(name: str) -> bool:
    effect = registry.find(name.partition("(")[0])
    return effect is None or effect.group != BASELINE
