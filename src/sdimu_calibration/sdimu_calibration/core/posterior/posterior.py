"""The diagnosis as one posterior: every model near the best one, with its probability."""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Generic

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.evidence.candidate import Candidate
from sdimu_calibration.core.evidence.joint_information import Joint
from sdimu_calibration.core.evidence.linear import E
from sdimu_calibration.core.evidence.testable import INDISTINGUISHABLE
from sdimu_calibration.core.evidence.wander import Wander
from sdimu_calibration.core.noise_term import KINDS, NoiseTerm
from sdimu_calibration.core.posterior.board import Board
from sdimu_calibration.core.posterior.climb import climbed, in_same_noise
from sdimu_calibration.core.posterior.combinations import combinations_of, crossed, exchanged
from sdimu_calibration.core.posterior.family import family_of
from sdimu_calibration.core.posterior.models import Members
from sdimu_calibration.core.posterior.noise_models import NoiseModel, every_kind
from sdimu_calibration.core.posterior.search import WINDOW, window
from sdimu_calibration.core.posterior.sharpening import hoped, sharpened

PROBABLE = 0.5
"""Probability from which a class of effects is told as found: more likely there than not."""
_OPEN = 0.02
"""Probability of a noise (1) from which the effects beside it are begun with when the point has moved: less would not
change what is told."""
_SEEN = 0.003
"""Probability of a noise (1) from which its kinds are looked for when the point has moved: those below it together are
less than is told."""
_INSTEAD = 0.05
"""Probability (1) of models without a class from which an effect that they hold is told as one of it: one in twenty."""
_SELDOM = 0.1
"""Probability of an effect beside a class, over that where the class is not (1), up to which it stands in its place: of
two that have nothing to do with each other it is one."""
_MOST_SHARPENED = 20
"""Number of times or time constants that are put between those of the scan at most: each takes a climb."""


@dataclass(frozen=True)
class Weighed:
    """One model of the window."""

    members: Members
    noise: NoiseModel
    probability: float


@dataclass(frozen=True)
class Posterior(Generic[E]):
    """The models that the data leave probable."""

    board: Board[E]
    models: tuple[Weighed, ...]
    """The likeliest first."""
    noises: tuple[tuple[NoiseModel, float], ...]
    """Every noise that is probable, each with its probability, the likeliest first: those of the models, and those in
    which no effects were looked for because they differ little from one of these."""

    @property
    def best(self) -> Weighed:
        """The likeliest model."""
        return self.models[0]

    @cached_property
    def told(self) -> Weighed:
        """The model that is told: of what is probable, the likeliest that is so together.

        A family of many variants (a warm-up, of any time constant) shares its probability out; another one with a
        single variant, or no effect at all, is then ahead of each, and behind all of them together. So models count
        together that have something of the same: of each class of the best model, and of what is probable besides.
        Of those the one is told that has most of the likeliest family of each class.
        """
        classes = [frozenset(alike) for alike in self._classes_of(self.best)]
        probable = [numbers for numbers in self._families.values() if self._any_of(numbers) > PROBABLE]
        # What stands in the place of another one is not told beside it.
        besides = [numbers for numbers in probable if not any(numbers & alike for alike in classes)]
        if not classes and not besides:
            return self.best
        _, kind = np.unique(self._hold([*classes, *besides]), axis=0, return_inverse=True)
        likeliest = int(np.argmax(np.bincount(kind.ravel(), self._weights)))
        most = self._hold([*map(self._likeliest, classes), *besides]).sum(axis=1)
        return self.models[int(np.argmax(np.where(kind.ravel() == likeliest, most, -1)))]

    def _hold(self, every: Sequence[Iterable[int]]) -> Bools:
        """Whether each model holds one of some candidates; shape (models, len(every))."""
        return np.column_stack([self._holds[:, list(numbers)].any(axis=1) for numbers in every])

    @cached_property
    def _families(self) -> dict[tuple[str, str], frozenset[int]]:
        """Candidates of each family that some model holds."""
        out: dict[tuple[str, str], set[int]] = {}
        for number in self.held:
            out.setdefault(family_of(self.candidate(number)), set()).add(number)
        return {family: frozenset(numbers) for family, numbers in out.items()}

    def _likeliest(self, alike: Collection[int]) -> frozenset[int]:
        """Those of a class that are of its likeliest family; the whole class where it is improbable."""
        of_family: dict[str, set[int]] = {}
        for number in alike:
            of_family.setdefault(self.candidate(number).family, set()).add(number)
        if len(of_family) == 1 or self._any_of(alike) < PROBABLE:
            return frozenset(alike)
        return frozenset(max(of_family.values(), key=self._any_of))

    def _any_of(self, numbers: Iterable[int]) -> float:
        """Probability that one of some candidates is in the model."""
        return min(1.0, float(self._weights @ self._holds[:, list(numbers)].any(axis=1)))

    @cached_property
    def _weights(self) -> Floats:
        return np.array([m.probability for m in self.models])

    @cached_property
    def _holds(self) -> Bools:
        """Whether each model holds each candidate; shape (models, q), each column in one piece of memory."""
        model = np.repeat(np.arange(len(self.models)), [len(m.members) for m in self.models])
        out = np.zeros((len(self.board.use), len(self.models)), dtype=bool)
        out[[number for m in self.models for number, _ in m.members], model] = True
        return out.T

    @cached_property
    def held(self) -> list[int]:
        """Candidates that some model holds, in ascending order."""
        found: list[int] = np.flatnonzero(self._holds.any(axis=0)).tolist()
        return found

    def of_each(self, name: Mapping[int, str]) -> dict[str, float]:
        """Probability that the model holds a candidate of a name, the likeliest first.

        Parameters
        ----------
        name : mapping of int to str
            Of candidates; some may share one.
        """
        groups: dict[str, list[int]] = {}
        for number, one in name.items():
            groups.setdefault(one, []).append(number)
        total = {one: self._any_of(numbers) for one, numbers in groups.items()}
        return dict(sorted(total.items(), key=lambda item: (-item[1], item[0])))

    def given(self, numbers: Iterable[int]) -> Posterior[E]:
        """Keep the models that hold one of some candidates, as if it were known that one of them is there."""
        holds = self._holds[:, list(numbers)].any(axis=1)
        share = float(self._weights @ holds)
        kept = [self.models[k] for k in np.flatnonzero(holds)]
        return replace(self, models=tuple(replace(m, probability=m.probability / share) for m in kept))

    def candidate(self, number: int) -> Candidate:
        """Candidate of a member."""
        return self.board.evidence.candidate(int(self.board.use[number]))

    def probability(self, holds: Callable[[Weighed], bool]) -> float:
        """Probability of the models for which something holds."""
        return min(1.0, float(sum(m.probability for m in self.models if holds(m))))

    @property
    def tried(self) -> list[NoiseTerm]:
        """Kinds of noise that are probable, each once."""
        kinds = {t.identity: t for noise, p in self.noises if p > _SEEN for t in noise.terms}
        return list(kinds.values())

    def starts(self) -> list[dict[str, tuple[int, bool]]]:
        """Models from which a search about another point begins: what is told, and the likeliest in each noise.

        Returns
        -------
        list of dict of str to (int, bool)
            Of each the width of each member, and whether it was made between those of a scan; by label.
        """
        likeliest: dict[frozenset[Hashable], Weighed] = {}
        share: dict[frozenset[Hashable], float] = {}
        for model in self.models:
            likeliest.setdefault(model.noise.key, model)
            share[model.noise.key] = share.get(model.noise.key, 0.0) + model.probability
        others = [likeliest[kinds] for kinds, p in share.items() if p > _OPEN]
        return [self._labels(model) for model in (self.told, *others)]

    def _labels(self, model: Weighed) -> dict[str, tuple[int, bool]]:
        finer = self.board.finer
        return {self.candidate(k).label: (width, int(self.board.use[k]) in finer) for k, width in model.members}

    @cached_property
    def classes(self) -> tuple[tuple[int, ...], ...]:
        """What may be in the place of each member of the told model.

        Candidates; those that fit as well come first, then others of its family, then those that models hold where none
        of these is. The likeliest come before the others.
        """
        alike = [(*own, *self._in_place_of(own)) for own in self._classes_of(self.told)]
        others = [self._instead_of(own) for own in alike]
        # One that stands for two effects stands for one of them: models that hold it have one effect fewer.
        most = {k: max(range(len(others)), key=lambda j: others[j].get(k, 0.0)) for k in set().union(*others)}
        return tuple(
            (*own[1:], *(k for k in sorted(other, key=lambda k: -other[k]) if most[k] == place))
            for place, (own, other) in enumerate(zip(alike, others, strict=True))
        )

    def _instead_of(self, alike: tuple[int, ...]) -> dict[int, float]:
        """Candidates that models hold where they hold none of a class, with their probability there.

        Beside the class models hold them hardly ever.
        """
        has = self._holds[:, list(alike)].any(axis=1)
        with_it, without = self._weights * has, self._weights * ~has
        if without.sum() < _INSTEAD:
            return {}
        told = {number for number, _ in self.told.members}
        share = {k: float(without @ self._holds[:, k]) for k in self.held if k not in told}
        # Its probability beside the class is at most a share of that where the class is not.
        most = _SELDOM * with_it.sum() / without.sum()
        instead = {k: p for k, p in share.items() if p >= _INSTEAD and float(with_it @ self._holds[:, k]) <= most * p}
        return {k: p / float(without.sum()) for k, p in instead.items()}

    def _in_place_of(self, alike: tuple[int, ...]) -> list[int]:
        """Members of the family of a class's first candidate that models hold instead of it, rather than beside it."""
        family = self._families[family_of(self.candidate(alike[0]))]
        if len(family & {number for number, _ in self.told.members}) > 1:
            return []
        beside = self._holds[:, list(alike)].any(axis=1)
        share = {k: float(self._weights @ (self._holds[:, k] * np.where(beside, -1.0, 1.0))) for k in family}
        return sorted((k for k in family - set(alike) if share[k] > 0.0), key=lambda k: -share[k])

    def _classes_of(self, model: Weighed) -> list[tuple[int, ...]]:
        """Each member of a model, then what may stand in its place, the likeliest first."""
        near, prior = self.board.data(model.noise)[1].at(model.members), self.board.prior
        out = []
        for place, table in near.exchanges():
            own = model.members[place][0]
            odds = prior.log_more([k for k, _ in model.members[:place] + model.members[place + 1 :]])
            score = table.max(axis=1)
            fit = np.full(len(score), -np.inf)
            np.subtract(score, odds - odds[own], out=fit, where=np.isfinite(odds))
            alike = (score > -WINDOW) & (fit > -INDISTINGUISHABLE)
            alike[own] = False
            out.append((own, *(int(k) for k in np.argsort(-score) if alike[k])))
        return out

    def together(self, place: int) -> list[tuple[int, int, float]]:
        """Pairs of candidates that show as a member of the told model does, each with its probability in its place."""
        number, _ = self.told.members[place]
        pairs = combinations_of(self.board.data(self.told.noise)[1], number)
        without = self._weights * ~self._holds[:, number]
        return [(*pair, float(without @ self._holds[:, list(pair)].all(axis=1))) for pair in pairs]

    def of_class(self, place: int) -> float:
        """Probability that a member of the told model, or something of its class, is present."""
        return self._any_of((self.told.members[place][0], *self.classes[place]))

    def of_family(self, place: int) -> float:
        """Probability of as many of the family of a member of the told model as are told: one beside another is two."""
        family = self._families[family_of(self.candidate(self.told.members[place][0]))]
        told = sum(number in family for number, _ in self.told.members)
        return min(1.0, float(self._weights @ (self._holds[:, list(family)].sum(axis=1) >= told)))

    def place_of(self, column: int) -> int:
        """Place in the told model of a column of the evidence."""
        return self.board.columns(self.told.members).index(column)

    def alike(self, column: int) -> list[int]:
        """Columns of what may be in the place of a member of the told model, the likeliest first."""
        return [int(self.board.use[number]) for number in self.classes[self.place_of(column)]]

    def in_every_noise(self) -> Posterior[E]:
        """Weigh all kinds of noise beside the best effects: a search goes on with those alone that it began with."""
        board = self.board.as_stated
        beside = _in_excess(board.noises(self.best.members), self.board.excess)
        return replace(self, noises=_noises(self.models, beside))

    def of_noise(self, triad: str, kinds: Collection[str] = KINDS) -> float:
        """Probability that a triad has noise of one of some kinds."""
        return self.of_any_noise(lambda noise: any(t.triad == triad and t.kind in kinds for t in noise.terms))

    def of_any_noise(self, holds: Callable[[NoiseModel], bool]) -> float:
        """Probability of the noises of which something holds (1)."""
        return min(1.0, float(sum(p for noise, p in self.noises if holds(noise))))

    @cached_property
    def nothing(self) -> float:
        """Probability that no effect is missing."""
        return self.probability(lambda m: not m.members)


def posterior(
    evidence: E,
    allowed: Ints,
    wander: Wander | None,
    earlier: Joint | None = None,
    before: Posterior[E] | None = None,
    make: type[Board[E]] | Callable[..., Board[E]] = Board,
) -> Posterior[E]:
    """Find the models that an evidence leaves probable.

    Parameters
    ----------
    evidence : LinearEvidence
        In white noise.
    allowed : ndarray of int, shape (a,)
        Columns that may be in a model.
    wander : Wander or None
        Of the same test; None where no noise with a memory is looked for.
    earlier : Joint, optional
        Of an evidence with the same signatures, or the first ones of them.
    before : Posterior, optional
        About a point that differs little: the search begins with its likeliest models, and with its kinds of noise.
    make : callable
        Makes the board, of the parameters of `Board`.
    """
    begun: list[dict[str, tuple[int, bool]]] = [{}] if before is None else before.starts()
    labels = {label: own for one in begun for label, own in one.items()}
    first = len(evidence.weight)
    finer = {c for c in allowed.tolist() if labels.get(evidence.candidates[c - first].label, (0, False))[1]}
    board = make(evidence, allowed, frozenset(finer), wander, earlier)
    number = {evidence.candidates[c - first].label: k for k, c in enumerate(board.use.tolist())}
    named = [tuple(sorted((number[name], own[0]) for name, own in one.items() if name in number)) for one in begun]
    # About another point two of a start may be one, or a size have the other sign: that is no model any more.
    starts = [one for one in dict.fromkeys(named) if np.isfinite(board.data(NoiseModel())[1].at(one).score)]
    # Functions of the attitude stand in the place of many effects: no search from these leads there.
    wide = before is None or (_has_functions(wander) and not _has_functions(before.board.wander))
    tried = before.tried if before is not None and not wide else None
    if tried is not None and before is not None and wander is not None and wander is not before.board.wander:
        # In other stretches a kind that was far behind may not be.
        tried = every_kind(wander.cut)
    settled = not wide and len(starts) > 0
    noises, ends, beside = climbed(board, starts or [()], tried, settled)
    members = ends[0]
    asked: set[str] = set()
    made = 0
    while made < _MOST_SHARPENED:
        sharper = sharpened(board, members, noises[0]) or hoped(board, members, noises[0], asked)
        if sharper is None:
            break
        board, starts = sharper
        noises, members = in_same_noise(board, starts, noises)
        made += 1
    if made:
        noises, ends, beside = climbed(board, [members], tried, settled=True)
        members = ends[0]
    board = board.in_excess(board.excess_of(members, noises[0]))
    data = [board.data(noise) for noise in noises]
    best = data[0][1]
    others = exchanged(best, members, best.at(members).score - WINDOW)
    starts = [*ends, *crossed(best, members), *others]
    found = window([d for _, d in data], [offset for offset, _ in data], starts)
    models = _weighed(found, noises)
    return Posterior(board, models, _noises(models, _in_excess(beside, board.excess)))


def _in_excess(beside: Sequence[tuple[float, NoiseModel]], excess: float) -> list[tuple[float, NoiseModel]]:
    """Scale likelihoods of noises beside effects to a variance over that of the noises (1)."""
    return [((score - noise.log_prior) / excess + noise.log_prior, noise) for score, noise in beside]


def noises_of(board: Board[E]) -> list[NoiseModel]:
    """Find the noises that are probable beside the best effects, the likeliest first, then those beside none."""
    noises, _, beside = climbed(board, [()])
    return [*noises, *(noise for _, noise in beside), *(noise for _, noise in board.noises(()))]


def _has_functions(wander: Wander | None) -> bool:
    return wander is not None and wander.cut.functions is not None


def _noises(
    models: Sequence[Weighed], beside: Sequence[tuple[float, NoiseModel]]
) -> tuple[tuple[NoiseModel, float], ...]:
    """Weigh every noise: one in which no effects were looked for stands beside that of the models it is most like.

    Parameters
    ----------
    beside : sequence of (float, NoiseModel)
        Noises beside the best effects, with the log posterior of both (1).
    """
    weight: dict[NoiseModel, float] = {}
    for model in models:
        weight[model.noise] = weight.get(model.noise, 0.0) + model.probability
    of_kinds: dict[frozenset[Hashable], float] = {}
    for noise, w in weight.items():
        of_kinds[noise.key] = of_kinds.get(noise.key, 0.0) + w
    score = {noise.key: score for score, noise in reversed(beside)}
    known = [noise for noise in weight if noise.key in score]
    out = dict(weight)
    for _, noise in beside:
        if noise.key not in of_kinds and known:
            # Beside no noise in a triad effects stand in its place.
            like = min(
                known, key=lambda one: (len(one.triads ^ noise.triads), len(one.key ^ noise.key), -score[one.key])
            )
            out[noise] = of_kinds[like.key] * float(np.exp(score[noise.key] - score[like.key]))
    total = sum(out.values())
    return tuple(sorted(((noise, w / total) for noise, w in out.items()), key=lambda one: -one[1]))


def _weighed(found: dict[tuple[int, Members], float], noises: Sequence[NoiseModel]) -> tuple[Weighed, ...]:
    """Weigh models, the likeliest first.

    The prior of a noise holds the share of all its sizes: in two sizes it counts once beside each set of effects, in
    the likelier one.
    """
    once: dict[tuple[frozenset[Hashable], Members], tuple[tuple[int, Members], float]] = {}
    for item in sorted(found.items(), key=lambda item: (-item[1], item[0])):
        (k, members), _ = item
        once.setdefault((noises[k].key, members), item)
    ranked = list(once.values())
    weight = np.exp(np.array([score for _, score in ranked]) - ranked[0][1])
    share = (weight / weight.sum()).tolist()
    return tuple(Weighed(m, noises[k], p) for ((k, m), _), p in zip(ranked, share, strict=True))
