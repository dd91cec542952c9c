"""What a window of models says in numbers: the probability of nothing, of each family of effects, of each noise.

A family holds what one error of one sensor may come from: every slow change of a bias, else one effect of the
registry with any time constant. Which of its members it is may be open while the family is certain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.evidence.linear import E
from sdimu_calibration.core.noise_term import AXES, NoiseTerm, sensors_of
from sdimu_calibration.core.posterior.family import family_of
from sdimu_calibration.core.posterior.posterior import Posterior

LEAST = 0.01
"""Probability below which something is not told (1): it is one in a hundred."""
_MOST = 200
"""Number of models whose sizes are worked out, the likeliest first: they hold nearly all of the probability. Of the
others only those that hold something of which no size is known yet."""


@dataclass(frozen=True)
class Share:
    """Something that may be, and the probability that it is so."""

    name: str
    probability: float


@dataclass(frozen=True)
class MemberShare:
    """A member of a family."""

    label: str
    probability: float
    """Of the models that hold it."""
    value: float
    sigma: float
    """`value`, `sigma`: its size over these models (SI)."""
    unit: str
    display_unit: str


@dataclass(frozen=True)
class FamilyShare:
    """A family of effects on a sensor."""

    family: str
    sensor: str
    """As of `family_of`."""
    probability: float
    """Of the models that hold a member of it."""
    members: tuple[MemberShare, ...]
    """The likeliest first; those of less than `LEAST` are left out."""


@dataclass(frozen=True)
class NoiseShare:
    """A kind of noise with a memory."""

    triad: str
    kind: str
    probability: float
    """Of the models that hold it."""
    size: float
    """Geometric mean over these models (SI, `unit`)."""
    low: float
    high: float
    """`low`, `high`: ends of the interval of 95 % where the noise is told; NaN elsewhere."""
    unit: str
    axes: tuple[int, ...] = AXES
    """Sensors of the triad that have it: all but of an unknown function, which may be of some."""

    @property
    def where(self) -> str:
        """Name of the triad, or of its sensors that have the noise."""
        return sensors_of(self.triad, self.axes)


@dataclass(frozen=True)
class Probabilities:
    """What the data say of all that may be missing in a model, the likeliest first."""

    nothing: float
    """Probability that no effect is missing."""
    families: tuple[FamilyShare, ...]
    noise: tuple[NoiseShare, ...]


def probabilities(found: Posterior[E], told: Sequence[NoiseTerm] = ()) -> Probabilities:
    """Sum the weights of the models that hold each family, each of its members, each kind of noise.

    Parameters
    ----------
    told : sequence of NoiseTerm
        Noise with its intervals.
    """
    family = {k: "/".join(family_of(found.candidate(k))) for k in found.held}
    label = {k: found.candidate(k).label for k in found.held}
    of_label, of_family = found.of_each(label), found.of_each(family)
    members: dict[str, list[MemberShare]] = {}
    sizes = _sizes(found, [k for k in found.held if of_label[label[k]] >= LEAST])
    for k in found.held:
        share = of_label[label[k]]
        if share >= LEAST:
            p = found.candidate(k).parameter
            one = MemberShare(label[k], share, *sizes[k], p.unit, p.display_unit)
            members.setdefault(family[k], []).append(one)
    families = []
    for name, share in of_family.items():
        if share >= LEAST:
            word, _, sensor = name.partition("/")
            ranked = sorted(members.get(name, ()), key=lambda m: -m.probability)
            families.append(FamilyShare(word, sensor, share, tuple(ranked)))
    return Probabilities(found.nothing, tuple(families), _noise(found, told))


def of_coefficients(found: Posterior[E]) -> tuple[Share, ...]:
    """Probability of each coefficient of an effect, with any time constant; those of less than `LEAST` are left out."""
    return _shares(found.of_each({k: found.candidate(k).coefficient for k in found.held}))


def may_be(found: Posterior[E], place: int) -> tuple[Share, ...]:
    """Say what a member of the told model may be: each coefficient of its class, the likeliest first."""
    names = {k: found.candidate(k).coefficient for k in (found.told.members[place][0], *found.classes[place])}
    return _shares(found.of_each(names))


def _shares(total: dict[str, float]) -> tuple[Share, ...]:
    return tuple(Share(name, p) for name, p in total.items() if p >= LEAST)


def _sizes(found: Posterior[E], wanted: Sequence[int]) -> dict[int, tuple[float, float]]:
    """Mean and sigma of each member (SI) over the likely models that hold it, else in the likeliest that does."""
    missing = set(wanted)
    weight: dict[int, float] = {}
    first: dict[int, float] = {}
    second: dict[int, float] = {}
    for place, model in enumerate(found.models):
        held = {k for k, _ in model.members}
        if place >= _MOST and not missing:
            break
        if place >= _MOST and not missing & held:
            continue
        missing -= held
        near = found.board.data(model.noise)[1].at(model.members)
        for (k, _), mean, variance in zip(model.members, near.sizes.tolist(), near.variances.tolist(), strict=True):
            weight[k] = weight.get(k, 0.0) + model.probability
            first[k] = first.get(k, 0.0) + model.probability * mean
            second[k] = second.get(k, 0.0) + model.probability * (variance + mean**2)
    out = {}
    for k, w in weight.items():
        mean, unit = first[k] / w, float(found.board.size[k])
        out[k] = (mean * unit, float(np.sqrt(max(second[k] / w - mean**2, 0.0))) * unit)
    return out


def _noise(found: Posterior[E], told: Sequence[NoiseTerm]) -> tuple[NoiseShare, ...]:
    total: dict[str, float] = {}
    for noise, p in found.noises:
        for name in set(map(_kind, noise.terms)):
            total[name] = min(total.get(name, 0.0) + p, 1.0)
    interval = {_kind(t): (t.low, t.high) for t in told}
    out = []
    for name, share in sorted(total.items(), key=lambda item: (-item[1], item[0])):
        if share < LEAST:
            continue
        have = [(p, t) for noise, p in found.noises for t in noise.terms if _kind(t) == name]
        size = float(np.exp(sum(p * np.log(t.size) for p, t in have) / sum(p for p, _ in have)))
        term = have[0][1]
        low, high = interval.get(name, (float("nan"), float("nan")))
        out.append(NoiseShare(term.triad, term.kind, share, size, low, high, term.unit, term.axes))
    return tuple(out)


def _kind(term: NoiseTerm) -> str:
    return f"{term.where} {term.kind}"
