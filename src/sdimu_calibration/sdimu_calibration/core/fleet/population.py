"""The population of a type: mean and spread of every coefficient over units, and who does not belong to it.

A unit with several results has one value: their mean, weighted by errors and by what they vary beyond them. That
variance within units is estimated first, from the differences within units alone; given it, the variance between units
is that of the unit values. A unit is judged by the population of the others (externally studentised deviate; Cook &
Weisberg, Residuals and Influence in Regression, 1982, sec. 2.2), all units and coefficients together (Bonferroni).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.fleet.reml import RandomEffect, random_effect, spread_and_mean
from sdimu_calibration.core.plain_text import counted
from sdimu_calibration.core.probability import student_tail
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.wording import Option, Work

FALSE_ALARM = 0.05
"""Probability that a clean population has a unit out, over all units and coefficients: as of a single test."""
FEWEST_UNITS = 3
"""Number of units that make a population: with two nobody can say which one is out."""
CONTROL = 3.0
"""Control limits as a multiple of the spread (dimensionless): the individuals chart of Shewhart."""


@dataclass(frozen=True)
class Measured:
    """Results of one type, in one model and body frame."""

    names: tuple[str, ...]
    """Coefficients, length p."""
    values: Floats
    sigmas: Floats
    """`values`, `sigmas`: SI, one row a result, shape (m, p)."""
    serials: tuple[str, ...]
    """Unit of each result, length m."""
    dates_s: Floats
    """Shape (m,). Seconds (s) since any common moment; NaN unknown."""

    @property
    def units(self) -> tuple[str, ...]:
        """Serial of each unit, in the order in which they come."""
        return tuple(dict.fromkeys(self.serials))


def measured(
    names: Sequence[str], values: Floats, covariances: Floats, serials: Sequence[str], dates_s: Floats
) -> Measured:
    """Take results as a fleet; coefficients that a frame makes zero by definition are left out.

    Parameters
    ----------
    names : sequence of str, length p
    values : ndarray, shape (m, p)
        SI.
    covariances : ndarray, shape (m, p, p)
        SI.
    serials : sequence of str, length m
    dates_s : ndarray, shape (m,)
        As of `Measured` (s).
    """
    variances = np.diagonal(covariances, axis1=1, axis2=2)
    if not (np.isfinite(values).all() and np.isfinite(variances).all()):
        raise DataError("fleet: a result has a value or a covariance that is not a number; take it out of the folder")
    free = (variances > _FIXED * np.abs(values) ** 2).all(axis=0) & (variances > 0.0).all(axis=0)
    kept = np.flatnonzero(free)
    return Measured(
        tuple(names[k] for k in kept.tolist()), values[:, kept], np.sqrt(variances[:, kept]), tuple(serials), dates_s
    )


_FIXED = 1e-20
"""Share of the square of a value below which its variance is rounding: what the body frame fixes."""


@dataclass(frozen=True)
class Coefficient:
    """A coefficient over units, in SI.

    Attributes
    ----------
    between : RandomEffect
        Of the unit values.
    within : RandomEffect or None
        Of results of one unit; None where no unit has two.
    values, sigmas : ndarray, shape (u,)
        Of each unit (SI), with what its results vary.
    deviates : ndarray, shape (u,)
        Of each unit from the population of the others, in sigmas (dimensionless).
    p_values : ndarray, shape (u,)
        Of each unit by the deviate (probability), before Bonferroni.
    """

    name: str
    between: RandomEffect
    within: RandomEffect | None
    values: Floats
    sigmas: Floats
    deviates: Floats
    p_values: Floats

    @property
    def control_limits(self) -> tuple[float, float]:
        """Mean less and plus `CONTROL` spreads (SI)."""
        half = CONTROL * self.between.spread
        return self.between.mean - half, self.between.mean + half


@dataclass(frozen=True)
class Out:
    """A unit that does not belong to the population of the others by a coefficient."""

    unit: str
    coefficient: str
    deviate: float
    """In sigmas."""
    p_value: float
    """Adjusted for all units and coefficients."""


@dataclass(frozen=True)
class Population:
    """A type of units."""

    units: tuple[str, ...]
    """Serials, length u."""
    coefficients: tuple[Coefficient, ...]
    out: tuple[Out, ...]
    """Largest deviate first."""


def population(fleet: Measured) -> Population:
    """Estimate mean and spread of every coefficient over units, and find who is out."""
    units = fleet.units
    if len(units) < FEWEST_UNITS:
        raise DataError(
            f"fleet: what fits together is of {counted(len(units), 'unit')}; a population needs "
            f"{FEWEST_UNITS} units (state the unit of each recording: {Work.CALIBRATE} {Option.SERIAL})"
        )
    found = tuple(_coefficient(fleet, k) for k in range(len(fleet.names)))
    return Population(units, found, _out(units, found))


def without_those_out(fleet: Measured, people: Population) -> Measured:
    """Leave the results of units that are out; the same fleet where none is, or too few are left."""
    out = {one.unit for one in people.out}
    kept = [k for k, serial in enumerate(fleet.serials) if serial not in out]
    if not out or len(people.units) - len(out) < FEWEST_UNITS:
        return fleet
    return Measured(
        fleet.names, fleet.values[kept], fleet.sigmas[kept], tuple(fleet.serials[k] for k in kept), fleet.dates_s[kept]
    )


def _coefficient(fleet: Measured, k: int) -> Coefficient:
    within = within_units(fleet, k)
    values, sigmas = unit_values(fleet, k, within)
    deviates, p_values = deviates_from_others(values, sigmas)
    return Coefficient(fleet.names[k], random_effect(values, sigmas), within, values, sigmas, deviates, p_values)


def within_units(fleet: Measured, k: int) -> RandomEffect | None:
    """Estimate what results of a unit vary beyond their errors in coefficient `k`; None where no unit has two."""
    if len(fleet.units) == len(fleet.serials):
        return None
    return random_effect(fleet.values[:, k], fleet.sigmas[:, k], fleet.serials)


def unit_values(fleet: Measured, k: int, within: RandomEffect | None) -> tuple[Floats, Floats]:
    """Combine the results of each unit: values and sigmas (SI) in the order of `Measured.units`, shape (u,) each.

    Parameters
    ----------
    k : int
        Coefficient.
    within : RandomEffect or None
        What results of one unit vary.
    """
    member = np.equal.outer(np.array(fleet.serials), np.array(fleet.units)).astype(float)
    more = 0.0 if within is None else within.spread**2
    weight = 1.0 / (fleet.sigmas[:, k] ** 2 + more)
    total = weight @ member
    return (weight * fleet.values[:, k]) @ member / total, 1.0 / np.sqrt(total)


def deviates_from_others(values: Floats, sigmas: Floats) -> tuple[Floats, Floats]:
    """Studentise each value by the population of the others.

    Parameters
    ----------
    values, sigmas : ndarray, shape (u,)
        Measured values and their errors, in one unit.

    Returns
    -------
    deviates : ndarray, shape (u,)
        In sigmas of the others' spread, the value's own error and that of the others' mean (dimensionless).
    p_values : ndarray, shape (u,)
        Two-sided, by Student's t with u - 2 degrees of freedom: exact for equal errors that are small beside the
        spread, conservative where the errors are the larger part.
    """
    deviates, p_values = np.zeros(len(values)), np.ones(len(values))
    for k in range(len(values)):
        others = np.arange(len(values)) != k
        spread, mean = spread_and_mean(values[others], sigmas[others])
        of_mean = 1.0 / np.sum(1.0 / (spread**2 + sigmas[others] ** 2))
        deviates[k] = (values[k] - mean) / math.sqrt(spread**2 + sigmas[k] ** 2 + of_mean)
        p_values[k] = 2.0 * student_tail(abs(float(deviates[k])), len(values) - 2)
    return deviates, p_values


def _out(units: tuple[str, ...], found: tuple[Coefficient, ...]) -> tuple[Out, ...]:
    tests = len(units) * len(found)
    out = [
        Out(units[k], one.name, float(one.deviates[k]), min(1.0, tests * float(one.p_values[k])))
        for one in found
        for k in np.flatnonzero(tests * one.p_values < FALSE_ALARM)
    ]
    return tuple(sorted(out, key=lambda o: o.p_value))
