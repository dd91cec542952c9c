"""Everything that results of one type say together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effect_key import effect_of
from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.effects.effect import BASELINE
from sdimu_calibration.core.fleet.common import FALSE_DISCOVERY, Bytes, CommonEffect, adjusted, common_effects
from sdimu_calibration.core.fleet.population import (
    Measured,
    Population,
    population,
    unit_values,
    within_units,
    without_those_out,
)
from sdimu_calibration.core.fleet.reml import RandomEffect, random_effect

YEAR_S = 365.25 * 86400.0
"""Julian year (s): the unit of time of slopes."""
PRODUCTION, AGE = "from unit to unit", "in the units"
_SHORTEST_S = 60.0
"""Shortest span of dates (s): results of one minute are of one date."""


@dataclass(frozen=True)
class Trend:
    """Slope of a coefficient with the date."""

    coefficient: str
    kind: str
    """`PRODUCTION`: between units, by their mean dates; `AGE`: within units that were measured again."""
    slope: float
    slope_sigma: float
    """`slope`, `slope_sigma`: SI a year."""
    p_value: float
    """If there is no slope."""
    q_value: float = 1.0
    """Smallest rate of false discoveries at which it is named."""
    named: bool = False


def trends(fleet: Measured) -> tuple[Trend, ...]:
    """Fit a slope with the date to every coefficient.

    Smallest probability first; none where dates are unknown or all the same.
    """
    if not np.isfinite(fleet.dates_s).all():
        return ()
    found = [
        Trend(name, kind, one.slope, one.slope_sigma, one.slope_p)
        for k, name in enumerate(fleet.names)
        for kind, one in ((PRODUCTION, _between(fleet, k)), (AGE, _within(fleet, k)))
        if one is not None
    ]
    q_values = adjusted(np.array([one.p_value for one in found]))
    judged = [
        replace(one, q_value=float(q), named=bool(q <= FALSE_DISCOVERY)) for one, q in zip(found, q_values, strict=True)
    ]
    return tuple(sorted(judged, key=lambda one: one.p_value))


def _between(fleet: Measured, k: int) -> RandomEffect | None:
    """Slope over units; None for fewer than four, or all of one date."""
    member = np.equal.outer(np.array(fleet.units), np.array(fleet.serials)).astype(float)
    dates = member @ fleet.dates_s / member.sum(axis=1)
    if len(dates) < 4 or np.ptp(dates) < _SHORTEST_S:
        return None
    return random_effect(*unit_values(fleet, k, within_units(fleet, k)), x=(dates - dates.mean()) / YEAR_S)


def _within(fleet: Measured, k: int) -> RandomEffect | None:
    """Slope in the units that have several results; None where there are too few, or all of one date."""
    serials, dates = np.array(fleet.serials), fleet.dates_s
    spans = [np.ptp(dates[serials == unit]) for unit in fleet.units]
    if len(serials) - len(spans) < 2 or max(spans) < _SHORTEST_S:
        return None
    return random_effect(fleet.values[:, k], fleet.sigmas[:, k], fleet.serials, (dates - dates.mean()) / YEAR_S)


@dataclass(frozen=True)
class Candidates:
    """Candidate effects of units, each alone beside the model."""

    names: tuple[str, ...]
    display_units: tuple[str, ...]
    """`names`, `display_units`: length k."""
    estimates: Floats
    sigmas: Floats
    """`estimates`, `sigmas`: shape (m, k). SI, one row a unit; NaN where it does not know an effect."""
    correlations: Bytes
    """Of the estimates in each unit, times `common.STEPS`, shape (m, k, k)."""


@dataclass(frozen=True)
class Study:
    """What results of one type say together."""

    fleet: Measured
    people: Population
    inside: Population
    """Without the units that are out: what priors and control limits are of."""
    slopes: tuple[Trend, ...]
    """Of the units that are not out."""
    common: tuple[CommonEffect, ...]
    """Effects beyond the baseline, smallest probability first."""


def study(fleet: Measured, model: Sequence[str], candidates: Candidates) -> Study:
    """Study results of one type.

    Effects that are in the model beyond the baseline are candidates of the type, too.

    `model`: effects that all results have. `candidates`: of the diagnoses; empty without any.
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
