"""The noises that are probable beside a set of effects: terms are added, sized together and exchanged.

The integral of the likelihood over a size is taken on a grid. The noise of the model is that of the best size, and its
prior holds the share of the prior that lies where the likelihood does: so the best size stands for the integral.
"""

from __future__ import annotations

from collections.abc import Collection, Hashable, Sequence
from dataclasses import dataclass, replace
from itertools import chain, product, repeat

import numpy as np

from sdimu_calibration.core.evidence.learned_noise import MOST_TERMS, InModes, InTriad, NoiseInformation
from sdimu_calibration.core.evidence.noise_kernels import Stretches
from sdimu_calibration.core.noise_term import DRAWN, TRIADS, Identity, NoiseTerm
from sdimu_calibration.core.posterior.noise_models import NoiseModel, Sizes, every_kind, log_odds
from sdimu_calibration.core.side_by_side import side_by_side

_NEAR = 6.0
"""Log posterior (1) behind the best noise up to which another one is kept: effects beside it may change that much."""
_MOST = 40
"""Number of noises that are kept at most: with eight kinds of each triad, those behind weigh a thousandth together."""
_SETTLED = 0.1
"""Gain of log posterior (1) from which sizes are taken in turn once more, and another noise is gone on from: less
changes no probability by more than a tenth."""
_MOST_STEPS = 4
"""Number of times at most that all sizes are taken in turn, and that another term takes the place of one of the best
noise: as many terms as a noise has."""
_SHARES = (0.3, 0.7)
"""Share (1) of what effects explain that one term, and two terms, must explain for more to be looked for: a third adds
less than the second."""
_BEHIND = 30.0
"""Log posterior (1) that noise may be behind effects in its place: effects beside it may make up for it."""
SEEN = 0.5
"""Log-likelihood (1) that a term must gain to be told from none: less is its prior."""
_SMALLER = 0.5
"""Size of noise beside an effect over that found beside none (1): the effect made most of it."""
_MOST_DRAWN = 3
"""Number of noises (1) with other drawn kinds in a triad that are looked at: behind them follow those of two kinds."""
_MOST_PAIRED = 3
"""Number of terms (1) that are looked at as one of two in a triad, and of pairs with each: the likeliest."""


@dataclass(frozen=True)
class _Found:
    """A noise, and its log-likelihood over white noise."""

    noise: NoiseModel
    gain: float

    @property
    def score(self) -> float:
        return self.gain + self.noise.log_prior


class _Search:
    """The noises beside one set of effects."""

    def __init__(
        self, information: NoiseInformation, cut: Stretches, usual: Sizes, tried: Sequence[NoiseTerm] | None
    ) -> None:
        self.information, self.cut, self.usual = information, cut, usual
        self.tried = every_kind(cut) if tried is None else list(tried)
        self.seen: dict[frozenset[Identity], _Found] = {}
        self._sized: dict[Hashable, list[tuple[NoiseTerm, float]]] = {}
        self._looked_beside: set[tuple[str, frozenset[Identity]]] = set()

    def among(self, tried: Sequence[NoiseTerm]) -> _Search:
        """Begin anew with some kinds alone; what was sized stays known."""
        again = _Search(self.information, self.cut, self.usual, tried)
        again._sized = self._sized
        return again

    def keep(self, found: _Found) -> _Found:
        """Remember a noise."""
        old = self.seen.get(found.noise.kinds)
        if old is None or found.score > old.score:
            self.seen[found.noise.kinds] = found
        return found

    def climbed(self, rival: float = 0.0) -> _Found | None:
        """Add terms to white noise while that makes it likelier; None where it stays far behind effects of `rival`."""
        best = self.keep(_Found(NoiseModel(), 0.0))
        for share in chain(_SHARES, repeat(1.0, MOST_TERMS * len(TRIADS))):
            option = max(self.one_more(best), key=lambda found: found.score, default=best)
            if not option.score > best.score + _SETTLED:
                break
            if option.score < share * rival - _BEHIND:
                return None
            several = len(option.noise.terms) > 1
            best = max(self.settled(option.noise), option, key=lambda found: found.score) if several else option
        return best

    def one_more(self, base: _Found, triads: Collection[str] = TRIADS) -> list[_Found]:
        """Add each kind of noise of some triads to a noise, at its best size, where that is seen at all."""
        terms = base.noise.terms
        alike: dict[tuple[str, str, float], list[NoiseTerm]] = {}
        for term in self.tried:
            own = _of_triad(base.noise, term.triad)
            if term.triad in triads and len(own) < MOST_TERMS and not _is_in(term, own):
                alike.setdefault(term.identity[:3], []).append(term)
        sized = self._sized_beside(base.noise, list(alike.values()))
        return [
            self.keep(_Found(NoiseModel((*terms, term), (*base.noise.shares, share)), base.gain + term.gain))
            for term, share in chain.from_iterable(sized)
        ]

    def _sized_beside(
        self, noise: NoiseModel, alike: Sequence[Sequence[NoiseTerm]]
    ) -> list[list[tuple[NoiseTerm, float]]]:
        """Best sizes of kinds of noise beside a noise, each worked out once: steps of the search come back to it."""
        beside = tuple(tuple((t.identity, t.size) for t in _of_triad(noise, triad)) for triad in TRIADS)
        keys = [(beside, tuple(t.identity for t in own)) for own in alike]
        new = {key: own for key, own in zip(keys, alike, strict=True) if key not in self._sized}
        given = {
            triad: self.information.of_triad(triad, noise.terms, self.cut)
            for triad in {own[0].triad for own in new.values()}
        }
        found = side_by_side(lambda own: self._in_sensors(given[own[0].triad], own), new.values())
        self._sized.update(zip(new, found, strict=True))
        return [self._sized[key] for key in keys]

    def _in_sensors(self, given: InTriad, terms: Sequence[NoiseTerm]) -> list[tuple[NoiseTerm, float]]:
        """Best sizes of one kind of noise in each choice of sensors; a sensor that alone has none is in no choice."""
        modes = InModes.of(given, self.cut, terms[0].kind, terms[0].tau)
        out, without = [], set[int]()
        for term in sorted(terms, key=lambda t: len(t.axes)):
            if without & set(term.axes):
                continue
            found = self.sized(modes, term)
            if found is not None:
                out.append(found)
            elif len(term.axes) == 1:
                without.update(term.axes)
        return out

    def sized(self, modes: InModes, term: NoiseTerm) -> tuple[NoiseTerm, float] | None:
        """Best size of a term, and the log of its odds with the share of the sizes that the likelihood leaves."""
        size, gain = modes.sizes_on_grid(term.axes)
        if not len(size):
            return None
        log_posterior = gain + self.usual.log_density(term, size)
        best = int(np.argmax(log_posterior))
        if gain[best] < SEEN:
            return None
        step = np.gradient(np.log(size))
        log_mass = float(log_posterior[best] + np.log(np.sum(np.exp(log_posterior - log_posterior[best]) * step)))
        found = replace(term, size=float(size[best]), gain=float(gain[best]))
        return found, log_odds(term) + log_mass - float(gain[best])

    def without(self, best: _Found, place: int) -> _Found:
        """Leave one term out for another one in its place: the others keep the sizes that they have beside it.

        Sized without it they take up what it made, and whatever comes in its place looks worse than it is.
        """
        triad, fewer = best.noise.terms[place].triad, _without(best.noise, place)
        found = _Found(fewer, self.information.of_triad(triad, fewer.terms, self.cut).gain)
        if found.score > best.score - _BEHIND:
            self.settled(fewer)
        elif _of_triad(fewer, triad):
            self.settled(fewer, (triad,))
        return found

    def exchanged(self, best: _Found, place: int) -> None:
        """Put each other kind of noise in the place of a term.

        Nothing in the other triad takes the place of a term: `crossed` puts the triads together. Another term of the
        triad has another size beside it. Beside the same other terms this is done once, whichever term it was for.
        """
        triad = best.noise.terms[place].triad
        beside = triad, _kinds(_without(best.noise, place).terms)
        if beside in self._looked_beside:
            return
        self._looked_beside.add(beside)
        options = self.one_more(self.without(best, place), (triad,))
        for two in _first([one for one in options if len(_of_triad(one.noise, triad)) > 1], best.score - _BEHIND):
            self.settled(two.noise, (triad,))

    def crossed(self, best: _Found) -> None:
        """Combine what may stand in the place of the terms of each triad: the triads are nearly independent.

        What each alternative costs beside the other triad's best terms adds.
        """
        own = {triad: _kinds(_of_triad(best.noise, triad)) for triad in TRIADS}
        instead: dict[str, list[_Found]] = {triad: [] for triad in TRIADS}
        for found in self.seen.values():
            apart = [triad for triad in TRIADS if _kinds(_of_triad(found.noise, triad)) != own[triad]]
            if len(apart) == 1 and found.score > best.score - _NEAR:
                instead[apart[0]].append(found)
        gyro, accel = TRIADS
        for one, other in product(instead[gyro], instead[accel]):
            parts = [_alone(one.noise, gyro), _alone(other.noise, accel)]
            noise = NoiseModel(parts[0].terms + parts[1].terms, parts[0].shares + parts[1].shares)
            self.keep(_Found(noise, one.gain + other.gain - best.gain))

    def paired(self, best: _Found) -> None:
        """Look for two terms in a triad where a third one stands for both: beside it neither is seen."""
        for triad in TRIADS:
            rest = _alone(best.noise, TRIADS[1 - TRIADS.index(triad)])
            base = _Found(rest, self.information.of_triad(triad, rest.terms, self.cut).gain)
            for one in _first(self.one_more(base, (triad,)), best.score - _BEHIND):
                for two in _first(self.one_more(one, (triad,)), best.score - _BEHIND):
                    self.settled(two.noise, (triad,))

    def settled(self, noise: NoiseModel, triads: Collection[str] = TRIADS) -> _Found:
        """Find the sizes of the terms of some triads together, each in turn until they stand.

        What is no longer seen is left out. There is a term in these triads.
        """
        found = self._sized_in_turn(noise, triads)
        for _ in range(_MOST_STEPS - 1):
            if sum(t.triad in triads for t in found.noise.terms) < 2:
                break
            again = self._sized_in_turn(found.noise, triads)
            stands = again.score < found.score + _SETTLED
            found = max(found, again, key=lambda one: one.score)
            if stands:
                break
        return self.keep(found)

    def _sized_in_turn(self, noise: NoiseModel, triads: Collection[str]) -> _Found:
        """Take the best size of each term of some triads beside the others, once."""
        gain = 0.0
        sized = dict(enumerate(zip(noise.terms, noise.shares, strict=True)))
        for place in [k for k, term in enumerate(noise.terms) if term.triad in triads]:
            others = [found[0] for k, found in sized.items() if k != place]
            term = sized[place][0]
            given = self.information.of_triad(term.triad, others, self.cut)
            again = self.sized(InModes.of(given, self.cut, term.kind, term.tau), term)
            gain = given.gain
            if again is None:
                del sized[place]
            else:
                sized[place] = again
                gain += again[0].gain
        terms, shares = tuple(found[0] for found in sized.values()), tuple(found[1] for found in sized.values())
        return _Found(NoiseModel(terms, shares), gain)

    def best(self) -> _Found:
        """Give the likeliest noise so far."""
        return max(self.seen.values(), key=lambda found: found.score)


def _first(found: Sequence[_Found], least: float) -> list[_Found]:
    """Give the likeliest of some noises, from a score on: one of each choice of kinds, whatever the time constants."""
    out = dict[tuple[str, ...], _Found]()
    for one in sorted((one for one in found if one.score > least), key=lambda one: -one.score):
        out.setdefault(tuple(sorted(t.kind for t in one.noise.terms)), one)
    return list(out.values())[:_MOST_PAIRED]


def _otherwise(ranked: Sequence[_Found]) -> list[_Found]:
    """Noises with other terms in the place of one of the likeliest's: with an effect beside it one may be likelier."""
    far = [found for found in ranked if ranked[0].score - _BEHIND < found.score <= ranked[0].score - _NEAR]
    behind = {found.noise: found for found in far}
    near = [found.noise for found in ranked if found.score > ranked[0].score - _NEAR]
    likeliest, others = ranked[0].noise, [*near, *behind]
    out = [noise for triad in TRIADS for noise in _first_of_each(likeliest, others, triad)]
    out += _first_without_each(likeliest, others)
    return [behind[noise] for noise in dict.fromkeys(out) if noise in behind]


def _first_without_each(likeliest: NoiseModel, others: Sequence[NoiseModel]) -> list[NoiseModel]:
    """First noise that lacks the kind of each term that wanders by itself: another kind, or the others, made for it.

    A random walk stands for a ramp beside Gauss-Markov noise, which is likelier with the ramp alone.
    """
    out = dict[NoiseModel, None]()
    for term in likeliest.terms:
        own = ((noise, {one.kind for one in _of_triad(noise, term.triad)}) for noise in others)
        first = next((noise for noise, kinds in own if kinds and term.kind not in kinds), None)
        if term.kind not in DRAWN and first is not None:
            out[first] = None
    return list(out)


def _first_of_each(likeliest: NoiseModel, others: Sequence[NoiseModel], triad: str) -> list[NoiseModel]:
    """First noise of each choice of drawn kinds in a triad that is not that of the likeliest noise."""
    own, first = likeliest.drawn_in(triad), dict[frozenset[str], NoiseModel]()
    for noise in others if own else ():
        first.setdefault(noise.drawn_in(triad), noise)
    return [noise for drawn, noise in first.items() if drawn not in {own, frozenset()}][:_MOST_DRAWN]


def instead_of(likeliest: NoiseModel, others: Sequence[NoiseModel]) -> list[NoiseModel]:
    """List noises in which an effect is seen that a term of the likeliest noise stands for.

    Each term may be one: the others have their sizes then. What is likeliest without a kind that wanders has its own.
    Where other drawn terms come in its place, their size beside no effect has taken up the effect: they are made
    smaller.

    Parameters
    ----------
    others : sequence of NoiseModel
        Noises that are known, the likeliest first.

    Returns
    -------
    list of NoiseModel
    """
    out = [_without(likeliest, place) for place in range(len(likeliest.terms))]
    out += _first_without_each(likeliest, others)
    for triad in TRIADS:
        out += [_smaller(noise, triad) for noise in _first_of_each(likeliest, others, triad)]
    return list(dict.fromkeys(out))


def _without(noise: NoiseModel, place: int) -> NoiseModel:
    terms, shares = noise.terms, noise.shares
    return NoiseModel(terms[:place] + terms[place + 1 :], shares[:place] + shares[place + 1 :])


def _smaller(noise: NoiseModel, triad: str) -> NoiseModel:
    drawn = [t.triad == triad and t.kind in DRAWN for t in noise.terms]
    sized = [replace(t, size=_SMALLER * t.size) if one else t for t, one in zip(noise.terms, drawn, strict=True)]
    return replace(noise, terms=tuple(sized))


def _is_in(term: NoiseTerm, terms: Sequence[NoiseTerm]) -> bool:
    """Whether a sensor of a term has noise of its kind already."""
    return any(t.kind == term.kind and set(t.axes) & set(term.axes) for t in terms)


def _of_triad(noise: NoiseModel, triad: str) -> tuple[NoiseTerm, ...]:
    return tuple(t for t in noise.terms if t.triad == triad)


def _alone(noise: NoiseModel, triad: str) -> NoiseModel:
    """Noise of one triad."""
    own = [(term, share) for term, share in zip(noise.terms, noise.shares, strict=True) if term.triad == triad]
    return NoiseModel(tuple(term for term, _ in own), tuple(share for _, share in own))


def _kinds(terms: Sequence[NoiseTerm]) -> frozenset[Identity]:
    return frozenset(t.identity for t in terms)


def likeliest(
    information: NoiseInformation, cut: Stretches, usual: Sizes, tried: Sequence[NoiseTerm] | None = None
) -> NoiseModel:
    """Find the likeliest noise beside no effect: terms are added one by one.

    Parameters
    ----------
    tried : sequence of NoiseTerm, optional
        Kinds and time constants to look for; all of them without.
    """
    search = _Search(information, cut, usual, tried)
    search.climbed()
    return search.best().noise


def explored(
    information: NoiseInformation,
    cut: Stretches,
    usual: Sizes,
    tried: Sequence[NoiseTerm] | None = None,
    rival: float = 0.0,
    brief: bool = False,
) -> list[tuple[float, NoiseModel]]:
    """Find the noises that are probable beside one set of effects.

    Parameters
    ----------
    information : NoiseInformation
        Coefficients and effects are estimated along.
    tried : sequence of NoiseTerm, optional
        Kinds and time constants to look for; all of them without.
    rival : float
        Log posterior (1), over white noise, that effects reach in its place: noise that stays far behind is given up.
    brief : bool
        Terms are added one by one alone: no other ones are looked for in their place.

    Returns
    -------
    list of (float, NoiseModel)
        Log posterior of each over white noise (1), the likeliest first. Then those that have other terms in the place
        of one of its own. The last one is far behind where all others have terms that stand in the place of
        effects: it is the likeliest without them.
    """
    return _explored(_Search(information, cut, usual, tried), rival, brief)


def _explored(search: _Search, rival: float, brief: bool) -> list[tuple[float, NoiseModel]]:
    best = search.climbed(rival)
    if best is None:
        return []
    if best.noise.terms and not brief:
        search.paired(best)
        best = max(best, search.best(), key=lambda found: found.score)
    for _ in range(0 if brief else _MOST_STEPS):
        for place in range(len(best.noise.terms)) if len(best.noise.terms) > 1 else ():
            search.exchanged(best, place)
        if not search.best().score > best.score + _SETTLED:
            break
        best = search.settled(search.best().noise)
        search.one_more(best)
    search.crossed(search.best())
    ranked = sorted(search.seen.values(), key=lambda found: -found.score)
    near = [(found.score, found.noise) for found in ranked if found.score > ranked[0].score - _NEAR][:_MOST]
    near += [(found.score, found.noise) for found in _otherwise(ranked)]
    if any(noise.wanders_alone for _, noise in near):
        return near
    wandering = [term for term in search.tried if term.kind not in DRAWN]
    return [*near, *_explored(search.among(wandering), 0.0, brief)[:1]]
