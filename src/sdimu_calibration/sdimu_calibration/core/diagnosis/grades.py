"""What was found in words: what is certain, what is likely, and what is open, each with its size."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.diagnosis.found import Found
from sdimu_calibration.core.effect_key import parse_key
from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.evidence.candidate import OF_RECORDING
from sdimu_calibration.core.posterior.family import BIAS_DRIFT, family_of
from sdimu_calibration.core.posterior.told import Probabilities, Share
from sdimu_calibration.core.probability import in_percent, in_percents
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import from_si

CERTAIN = 0.99
"""Probability (1) from which an effect is called certain: one in a hundred is wrong then."""
NAMED = 0.05
"""Probability (1) from which something that may be there instead is named: one in twenty."""
LISTED = 4
"""Number of effects, or of those that may be one, that a sentence lists: more do not fit into one."""
_MORE_THAN_ONE = 1.005
"""Sum of probabilities (1) that shows as more than 100 %: models that hold two of the effects count for both."""


@dataclass(frozen=True)
class Graded:
    """Something that is missing: an effect, or a class or family of which one is."""

    words: str
    """The likeliest of it, with its size."""
    coefficient: str
    """Name of that in `may_be`."""
    size: str
    """Of the likeliest, with its sigma."""
    probability: float
    """That one of it is missing; NaN where no probabilities were worked out."""
    may_be: tuple[Share, ...] = ()
    """What it may be, the likeliest first; one alone, or none, where it is told which."""
    family: str = ""
    """What all of these are alike in, in words; empty where their names say it."""
    is_equation: bool = False
    """It is an equation that no physics names."""

    @property
    def of_named(self) -> float:
        """Probability of what is named: of all that it may be where that is open, else of the likeliest alone."""
        alone = self.may_be[0].probability if len(self.may_be) == 1 else self.probability
        return min(self.probability, alone)

    @property
    def certain(self) -> bool:
        """Whether it is certain that what is named is missing, or one of it."""
        return self.of_named >= CERTAIN

    @property
    def is_open(self) -> bool:
        """Whether it is open which of it is missing."""
        return len(self.may_be) > 1


def graded(found: Iterable[Found], told: Probabilities | None) -> tuple[Graded, ...]:
    """Grade what was found: by its class, or by its family where that is surer."""
    every = tuple(found)
    named = {one.candidate.coefficient for one in every}
    out = []
    for one in every:
        probability, shares = _grade(one, told, named)
        family = _family(one, shares, told)
        words, size_, own = _sized(one), size_of(one), one.candidate.family == "own"
        out.append(Graded(words, one.candidate.coefficient, size_, probability, shares, family, own))
    return tuple(out)


def in_grades(found: Sequence[Graded], certain: str = "Certain") -> str:
    """Say what was found by how sure it is, as `each_grade` does, in one text."""
    return " ".join(each_grade(found, certain))


def each_grade(found: Sequence[Graded], certain: str = "Certain") -> tuple[str, ...]:
    """Say what was found by how sure it is, a sentence a grade; without grades where no probabilities were worked out.

    Parameters
    ----------
    certain : str
        Word before what is certain.
    """
    if any(np.isnan(one.probability) for one in found):
        return (f"Missing in the model: {listed(one.words for one in found)}.",)
    firm = [one.words for one in found if one.certain and not one.is_open]
    told = [f"{certain}: {listed(firm)}."] if firm else []
    told += [f"{certain}, but open which: {_open(one)}." for one in found if one.certain and one.is_open]
    told += [f"Likely ({in_percent(one.of_named)}): {_likely(one)}." for one in found if not one.certain]
    more = len(told) - LISTED
    return (*told[:LISTED], *([f"{more} more {'is' if more == 1 else 'are'} in the table."] if more > 0 else []))


def _family(one: Found, shares: Sequence[Share], told: Probabilities | None) -> str:
    """Name the slow change of a bias of which all shares are: ramp, warm-up and cable wrap do not say what they share.

    `shares`: coefficients that it may be; `told`: with the families.
    """
    name, sensor = family_of(one.candidate)
    members = [f.members for f in (told.families if told else ()) if (f.family, f.sensor) == (name, sensor)]
    known = {without_variant(member.label) for every in members for member in every}
    is_drift = name.endswith(BIAS_DRIFT) and all(share.name in known for share in shares)
    return f"a slow change of the bias of {sensor.replace('_', ' ')}" if is_drift else ""


def _grade(one: Found, told: Probabilities | None, named: Collection[str]) -> tuple[float, tuple[Share, ...]]:
    """Probability that something of its class, or family, is missing; what that may be, the likeliest first.

    `named` are the coefficients of all that was found: what stands beside it is not there instead of it.
    """
    shares = tuple(share for share in one.may_be if share.probability >= NAMED)
    if not one.of_family > one.probability or told is None:
        return one.probability, shares
    of_family = family_of(one.candidate)
    family = next((f for f in told.families if (f.family, f.sensor) == of_family), None)
    members: dict[str, float] = {}
    for member in family.members if family else ():
        name = without_variant(member.label)
        members[name] = members.get(name, 0.0) + member.probability
    known = {share.name: share.probability for share in one.may_be}
    # Models may hold two time constants of one effect: where the class knows it, the sum counts them once.
    every = sorted(((known.get(name, min(p, 1.0)), name) for name, p in members.items()), key=lambda item: -item[0])
    beside = set(named) - {one.candidate.coefficient}
    several = tuple(Share(name, p) for p, name in every if p >= NAMED and name not in beside)
    return one.of_family, several or shares


def _likely(one: Graded) -> str:
    return _open(one) if one.is_open else one.words


def _open(one: Graded) -> str:
    """Name what it may be, each with its probability; the likeliest with its size, and how likely it is none."""
    sizes = {one.coefficient: f" ({one.size})"}
    shown = one.may_be[:LISTED]
    percent = percents_of(one.may_be)
    told = [f"{named(s.name)}{sizes.get(s.name, '')} {percent[s.name]}" for s in shown]
    together = math.fsum(s.probability for s in shown)
    rest = round(100.0 * one.probability) - round(100.0 * together)
    told += [f"another one {rest} %"] if rest > 0 else []
    both = "; two of them may be there" if together > _MORE_THAN_ONE else ""
    of_family = f"{one.family} - " if one.family else ""
    return f"{of_family}{', '.join(told[:-1])} or {told[-1]}{both}" if len(told) > 1 else told[0]


def percents_of(shares: Iterable[Share]) -> dict[str, str]:
    """Write the probability of each thing that something may be, by its name; those that are named add up."""
    every = tuple(shares)
    by_itself = {one.name: in_percent(one.probability) for one in every}
    told = [one for one in every if one.probability >= NAMED]
    together = in_percents([one.probability for one in told])
    return by_itself | {one.name: text for one, text in zip(told, together, strict=True)}


def _sized(one: Found) -> str:
    return f"{name_of(one)} ({size_of(one)})"


def size_of(one: Found) -> str:
    """Write the size of an effect with its sigma: ``39.96 +- 0.96 ppm``."""
    return size(one.value, one.sigma, one.candidate.parameter.display_unit)


def size(value: float, sigma: float, unit: str) -> str:
    """Write an SI value with its sigma in `unit`."""
    value, sigma = from_si(value, unit), from_si(sigma, unit)
    return f"{value:.{decimals(sigma)}f} +- {sigma:.{decimals(sigma)}f} {unit}"


def decimals(sigma: float) -> int:
    """Count the decimals that show two digits of a sigma, and no more of its value."""
    return max(0, 1 - int(np.floor(np.log10(sigma)))) if np.isfinite(sigma) and sigma > 0.0 else 0


def name_of(one: Found) -> str:
    """Name an effect that was found in words, its axis behind it: ``gyro scale-factor asymmetry, y``."""
    candidate = one.candidate
    if candidate.family == "own":
        return candidate.label
    axis = candidate.label.partition("(")[0].removeprefix(candidate.family).strip("_")
    return _with_axis(candidate.effect.title, axis, candidate.effect.variant)


def named(coefficient: str) -> str:
    """Name a coefficient in words, its axis behind the effect; one that no catalogue knows by itself."""
    coefficient, _, recording = coefficient.partition(OF_RECORDING)
    if recording:
        return f"{named(coefficient)} in {recording} alone"
    try:
        effect = resolve(coefficient)
    except DataError:
        return coefficient
    axis = coefficient.partition("(")[0].removeprefix(effect.family or effect.name).strip("_")
    # A name without its time constant holds for every one.
    return _with_axis(effect.title, axis, effect.variant if "(" in coefficient else "")


def other_coefficients(label: str, alike: Iterable[str]) -> tuple[str, ...]:
    """Labels of another coefficient, or of the same one in another recording: no other time constant of its own."""
    own = without_variant(label)
    return tuple(other for other in alike if without_variant(other) != own)


def without_variant(label: str) -> str:
    """Return a label without its time constant; an equation, whose brackets belong to its formula, as it is."""
    key, at, recording = label.partition(OF_RECORDING)
    return f"{parse_key(key).name}{at}{recording}"


def _with_axis(title: str, axis: str, variant: str) -> str:
    return " ".join(part for part in (f"{title}, {axis}" if axis else title, variant) if part)


def listed(words: Iterable[str]) -> str:
    """Join words; of many the first ones, and how many more there are."""
    every = list(words)
    if len(every) <= LISTED:
        return " and ".join(every)
    return f"{', '.join(every[: LISTED - 1])} and {len(every) - LISTED + 1} more"
