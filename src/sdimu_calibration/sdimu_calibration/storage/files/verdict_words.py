"""The verdict of a diagnosis in one sentence: what is certain, what is likely, and what is open, each with its size."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.diagnosis.found import Found
from sdimu_calibration.core.diagnosis.summary import DiagnosisSummary
from sdimu_calibration.core.diagnosis.verdict import CERTAIN
from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.posterior.family import family_of
from sdimu_calibration.core.posterior.told import Probabilities, Share
from sdimu_calibration.core.probability import in_percent
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import from_si
from sdimu_calibration.core.verdict import Verdict

NAMED = 0.05
"""Probability (1) from which something that may be there instead is named: one in twenty."""
_LISTED = 4
"""Number of effects, or of those that may be one, that a sentence lists: more do not fit into one."""
_FOUND = (Verdict.ONE_EFFECT, Verdict.CLASS_OF_EFFECTS, Verdict.SEVERAL_EFFECTS, Verdict.OWN_EQUATION)


@dataclass(frozen=True)
class Graded:
    """Something that is missing: an effect, or a class or family of which one is.

    Attributes
    ----------
    found : Found
        The likeliest of it.
    probability : float
        That one of it is missing; NaN where no probabilities were worked out.
    may_be : tuple of Share
        What it may be, the likeliest first; one alone where it is told which.
    """

    found: Found
    probability: float
    may_be: tuple[Share, ...]

    @property
    def certain(self) -> bool:
        """Whether it is certain that one of it is missing."""
        return self.probability >= CERTAIN

    @property
    def is_open(self) -> bool:
        """Whether it is open which of it is missing."""
        return len(self.may_be) > 1


def graded(summary: DiagnosisSummary) -> tuple[Graded, ...]:
    """Grade what was found: by its class, or by its family where that is surer."""
    return tuple(_grade(one, summary.diagnosis.probabilities) for one in summary.candidates)


def _grade(one: Found, told: Probabilities | None) -> Graded:
    shares = tuple(share for share in one.may_be if share.probability >= NAMED)
    if not one.of_family > one.probability or told is None:
        return Graded(one, one.probability, shares)
    of_family = family_of(one.candidate)
    family = next((f for f in told.families if (f.family, f.sensor) == of_family), None)
    members: dict[str, float] = {}
    for member in family.members if family else ():
        name = member.label.partition("(")[0]
        members[name] = members.get(name, 0.0) + member.probability
    known = {share.name: share.probability for share in one.may_be}
    # Models may hold two time constants of one effect: where the class knows it, the sum counts them once.
    every = sorted(((known.get(name, min(p, 1.0)), name) for name, p in members.items()), key=lambda item: -item[0])
    listed = tuple(Share(name, p) for p, name in every if p >= NAMED)
    return Graded(one, one.of_family, listed or shares)


def headline(summary: DiagnosisSummary) -> str:
    """Say the verdict in one sentence: what was found by how sure it is; else the sentence of the diagnosis."""
    d = summary.diagnosis
    if d.verdict not in _FOUND or not summary.candidates:
        return d.sentence
    found = graded(summary)
    if any(np.isnan(one.probability) for one in found):
        begun = "An equation that the catalogue lacks fits" if d.own else "Missing in the model"
        return f"{begun}: {_listed(map(_sized, found))}."
    firm = [one for one in found if one.certain and not one.is_open]
    told = [f"Certain: {_listed(map(_sized, firm))}."] if firm else []
    told += [f"Certain, but open which: {_open(one)}." for one in found if one.certain and one.is_open]
    told += [f"Likely ({in_percent(one.probability)}): {_likely(one)}." for one in found if not one.certain]
    more = len(told) - _LISTED
    words = " ".join(told[:_LISTED]) + (f" {more} more are in the table." if more > 0 else "")
    return f"No effect of the catalogue fits, an equation does. {words}" if d.own else words


def _likely(one: Graded) -> str:
    return _open(one) if one.is_open else _sized(one)


def _open(one: Graded) -> str:
    """Name what it may be, each with its probability; the likeliest with its size."""
    own = one.found.candidate.coefficient
    told = [
        f"{named(share.name)}{f' ({size_of(one.found)})' if share.name == own else ''} {in_percent(share.probability)}"
        for share in one.may_be[:_LISTED]
    ]
    return " or ".join([", ".join(told[:-1]), told[-1]]) if len(told) > 1 else told[0]


def _sized(one: Graded) -> str:
    return f"{name_of(one.found)} ({size_of(one.found)})"


def size_of(one: Found) -> str:
    """Write the size of an effect with its sigma: ``39.96 +- 0.96 ppm``."""
    unit = one.candidate.parameter.display_unit
    sigma = from_si(one.sigma, unit)
    # Two digits of sigma, and no more of the value.
    decimals = max(0, 1 - int(np.floor(np.log10(sigma)))) if np.isfinite(sigma) and sigma > 0.0 else 0
    return f"{from_si(one.value, unit):.{decimals}f} +- {sigma:.{decimals}f} {unit}"


def name_of(one: Found) -> str:
    """Name an effect that was found in words, its axis behind it: ``gyro scale-factor asymmetry, y``."""
    candidate = one.candidate
    if candidate.family == "own":
        return candidate.label
    axis = candidate.label.partition("(")[0].removeprefix(candidate.family).strip("_")
    return _with_axis(candidate.effect.title, axis, candidate.effect.variant)


def named(coefficient: str) -> str:
    """Name a coefficient in words, its axis behind the effect; one that no catalogue knows by itself."""
    try:
        effect = resolve(coefficient)
    except DataError:
        return coefficient
    axis = coefficient.partition("(")[0].removeprefix(effect.family or effect.name).strip("_")
    # A name without its time constant holds for every one.
    return _with_axis(effect.title, axis, effect.variant if "(" in coefficient else "")


def _with_axis(title: str, axis: str, variant: str) -> str:
    return " ".join(part for part in (f"{title}, {axis}" if axis else title, variant) if part)


def _listed(words: Iterable[str]) -> str:
    every = list(words)
    if len(every) <= _LISTED:
        return " and ".join(every)
    return f"{', '.join(every[: _LISTED - 1])} and {len(every) - _LISTED + 1} more"
