"""Everything that results of one type say together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effect_key import effect_of
from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.effects.effect import BASELINE
from sdimu_calibration.core.fleet.common import CommonEffect, common_effects
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
    """

    names: tuple[str, ...]
    display_units: tuple[str, ...]
    estimates: Floats
    sigmas: Floats


@dataclass(frozen=True)
class Study:
    """What results of one type say together.

    Attributes
    ----------
    fleet : Measured
    people : Population
    inside : Population
        Without the units that are out: what priors and control limits are of.
    slopes : tuple of Trend
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
    fleet : Measured
    model : sequence of str
        Effects that all results have.
    candidates : Candidates
        Of the diagnoses; empty without any.

    Raises
    ------
    DataError
        When there are too few units.
    """
    people = population(fleet)
    own = [one for one in people.coefficients if _beyond_baseline(effect_of(one.name, model))]
    rest = [k for k, name in enumerate(candidates.names) if name not in {one.name for one in own}]
    names = [one.name for one in own] + [candidates.names[k] for k in rest]
    rows = max(len(people.units), len(candidates.estimates))
    estimates, sigmas = (
        np.hstack([_padded([getattr(one, of) for one in own], rows), _padded(table[:, rest].T, rows)])
        for of, table in (("values", candidates.estimates), ("sigmas", candidates.sigmas))
    )
    inside = without_those_out(fleet, people)
    return Study(fleet, people, inside, trends(fleet), common_effects(names, estimates, sigmas))


def _beyond_baseline(name: str) -> bool:
    effect = registry.find(name.partition("(")[0])
    return effect is None or effect.group != BASELINE


def _padded(columns: Sequence[Floats] | Floats, rows: int) -> Floats:
    """Columns as a table (rows, columns), with NaN below those that are shorter."""
    out = np.full((rows, len(columns)), np.nan)
    for k, column in enumerate(columns):
        out[: len(column), k] = column
    return out
