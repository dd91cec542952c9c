"""What a window of models says in words and numbers: the probability of each effect, family, noise, and of nothing."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass

from sdimu_calibration.core.evidence.linear import E
from sdimu_calibration.core.posterior.posterior import Posterior, Weighed

LEAST = 0.005
"""Probability below which something is not told (1): it is one in two hundred."""


@dataclass(frozen=True)
class Share:
    """Something that may be, and the probability that it is so.

    Attributes
    ----------
    name : str
    probability : float
    """

    name: str
    probability: float


@dataclass(frozen=True)
class Probabilities:
    """What the data say of all that may be missing in a model, the likeliest first; below `LEAST` nothing is told.

    Attributes
    ----------
    nothing : float
        Probability that no effect is missing.
    families : tuple of Share
        By registry name of the effect: on any axis, with any time constant.
    effects : tuple of Share
        By name of the coefficient: with any time constant.
    noise : tuple of Share
        Noise with a memory, by triad and kind.
    """

    nothing: float
    families: tuple[Share, ...]
    effects: tuple[Share, ...]
    noise: tuple[Share, ...]


def probabilities(found: Posterior[E]) -> Probabilities:
    """Sum the weights of the models that hold each effect, family and kind of noise."""
    q = len(found.board.use)
    family = [found.candidate(k).family for k in range(q)]
    name = [found.parameter(k) for k in range(q)]
    return Probabilities(
        found.nothing,
        _summed(found, lambda m: (family[k] for k, _ in m.members)),
        _summed(found, lambda m: (name[k] for k, _ in m.members)),
        _summed(found, lambda m: (f"{t.triad} {t.kind}" for t in m.noise.terms)),
    )


def may_be(found: Posterior[E], place: int) -> tuple[Share, ...]:
    """Say what a member of the told model may be: each coefficient of its class, the likeliest first."""
    names = {k: found.parameter(k) for k in (found.told.members[place][0], *found.classes[place])}
    return _summed(found, lambda m: (names[k] for k, _ in m.members if k in names))


def _summed(found: Posterior[E], names: Callable[[Weighed], Iterable[Hashable]]) -> tuple[Share, ...]:
    total: dict[str, float] = {}
    for model in found.models:
        for name in {str(one) for one in names(model)}:
            total[name] = total.get(name, 0.0) + model.probability
    ranked = sorted(total.items(), key=lambda item: (-item[1], item[0]))
    return tuple(Share(name, min(p, 1.0)) for name, p in ranked if p >= LEAST)
