"""The search for noises and effects in turn: each beside the best of the other, until neither changes."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from sdimu_calibration.core.evidence.linear import E
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.posterior.board import Board, same_noise
from sdimu_calibration.core.posterior.models import Members
from sdimu_calibration.core.posterior.noise_models import NoiseModel
from sdimu_calibration.core.posterior.search import WINDOW, best_from

_ROUNDS = 4
"""Number of times that noises and effects are looked for in turn: each beside the best of the other."""
_TIE = 0.5
"""Log posterior (1) by which another model must beat the one that a search begins with: fits about two that look the
same would go to and fro."""
_HOPEFUL = 15.0
"""Log posterior (1) behind the best model up to which effects are looked for in a noise: more do not make up for it."""
_FAR = 30.0
"""Log posterior (1) behind the best model from which effects in the noises that are known are looked at no further: a
kind of noise that is known beside no others adds less."""
_NOISES = 6
"""Number of noises in which effects are looked for, the likeliest first: each takes a climb."""
_FEW = 2
"""Number of noises in which effects are looked for again when a time constant was sharpened: the likeliest."""
_IN_PLACE = 2
"""Number of effects (1) that one term of noise may stand for: beside two the noise is looked for anew."""


def climbed(
    board: Board[E], starts: Sequence[Members], tried: Sequence[NoiseTerm] | None = None, settled: bool = False
) -> tuple[list[NoiseModel], list[Members], list[tuple[float, NoiseModel]]]:
    """Look for noises beside the best effects, and for effects in each noise, until neither changes.

    Beside effects without one family of drifts, and beside rivals, only kinds that are known are looked for.
    Where a search about nearly the same point has looked for noises beside no effects, too, it is `settled`: they are
    looked for beside the best effects, these without drifts, and those of the start, and only the kinds that were
    `tried`; all kinds without any.

    Returns
    -------
    noises : list of NoiseModel
        That of the best model first.
    ends : list of tuple of (int, int)
        The best model, then the best one in each of the noises.
    beside : list of (float, NoiseModel)
        Noises beside the effects of the best model, with the log posterior of both (1).
    """
    asked: dict[Members, list[tuple[float, NoiseModel]]] = {}
    known: list[tuple[float, NoiseModel, Members]] = []
    start = starts[0]
    white = board.data(NoiseModel())[1]
    if settled and tried:
        # What white noise asks for beside noise that is probable are no effects.
        best, members = white.at(start).score, start
    else:
        best, members = max(
            (best_from(white, one, of_two=not board.has_noises) for one in starts), key=lambda found: found[0]
        )
    rivals: list[Members] = []
    # Beside which effects only the kinds that were known then were looked for.
    partly: set[Members] = set()
    for turn in range(_ROUNDS):
        beside = [members, without_drifts(board, members), *(starts if settled else [()])]
        part = [*_without_a_family(board, members), *rivals]
        wanted = [
            one for one in dict.fromkeys([*beside, *part]) if one not in asked or (one == members and one in partly)
        ]
        if members not in wanted and not rivals:
            break
        # Few effects first: beside many that white noise asked for, noise that is far behind is given up at once.
        for one in sorted(wanted, key=len):
            asked[one], whole = _noises_beside(board, one, tried, best, _kinds(known), one in part)
            partly = partly - {one} if whole else partly | {one}
            for score, noise in asked[one]:
                _add(known, score, noise, one)
                best = max(best, score)
        # Beside effects that are no model in that noise a noise may be better than all models: it counts no further.
        hopeful = min(best, max(score for score, _, _ in known)) - _HOPEFUL
        ranked = sorted(known, key=lambda found: -found[0])
        near = [found for found in ranked if found[0] >= hopeful][:_NOISES]
        if not any(noise.wanders_alone for _, noise, _ in near):
            # Noise that hangs on attitude or rate took up what may be an effect, which is seen only without that noise.
            near += [found for found in ranked if found[1].wanders_alone][:1]
        known = []
        for _, noise, one in near:
            offset, data = board.data(noise)
            trials = [best_from(data, begin, of_two=False) for begin in dict.fromkeys([members, one, *starts])]
            gain, found = max(trials, key=lambda t: t[0])
            if not np.isfinite(gain):  # none of these is a model in that noise
                gain, found = best_from(data, (), of_two=False)
            known.append((offset + gain, noise, found))
        known.sort(key=lambda found: -found[0])
        offset, data = board.data(known[0][1])
        score, members = best_from(data, known[0][2])
        if start and data.at(start).score > score - _TIE:
            members = start
        best = max(best, offset + score)
        in_place = _in_place(board, ranked) if turn + 1 < _ROUNDS else []
        weighed = [(score, one) for score, _, one in known] + in_place
        rivals = _rivals(weighed, known[0][0] - WINDOW, {members, *asked})
    if members not in asked or members in partly:
        asked[members] = board.noises(members, tried, best)
    kept = [(noise, one) for score, noise, one in known if score > known[0][0] - WINDOW]
    return [noise for noise, _ in kept], list(dict.fromkeys([members, *(one for _, one in kept)])), asked[members]


def _kinds(known: Sequence[tuple[float, NoiseModel, Members]]) -> list[NoiseTerm]:
    """Kinds of noise that are known beside some effects, each once."""
    return list({t.identity: t for _, noise, _ in known for t in noise.terms}.values())


def _noises_beside(
    board: Board[E],
    members: Members,
    tried: Sequence[NoiseTerm] | None,
    best: float,
    known: Sequence[NoiseTerm],
    rival: bool,
) -> tuple[list[tuple[float, NoiseModel]], bool]:
    """Noises beside effects; of kinds that are `known` beside others alone for a rival, or where these are far behind.

    Returns
    -------
    noises : list of (float, NoiseModel)
    whole : bool
        Whether all kinds that are `tried` were looked for.
    """
    if tried is None and known:
        # A brief search tells noise that is far behind.
        found = board.noises(members, known, best, brief=not rival)
        if rival or max((score for score, _ in found), default=-np.inf) < best - _FAR:
            return found, False
    return board.noises(members, tried, best), True


def in_same_noise(
    board: Board[E], starts: Sequence[Members], noises: Sequence[NoiseModel]
) -> tuple[list[NoiseModel], Members]:
    """Climb again in the likeliest noises that are known: a finer time constant changes little of them."""
    found = []
    for place, noise in enumerate(noises[:_FEW]):
        offset, data = board.data(noise)
        score, members = max((best_from(data, one, of_two=False) for one in starts), key=lambda t: t[0])
        found.append((offset + score, -place, members))
    found.sort(reverse=True)
    order = [-place for _, place, _ in found]
    return [*(noises[k] for k in order), *noises[_FEW:]], found[0][2]


def _rivals(found: Sequence[tuple[float, Members]], least: float, known: Collection[Members]) -> list[Members]:
    """Choose effects beside which noise is looked for though others are ahead: the likeliest, from a log posterior on.

    A size that was found beside other effects took up what these explain: beside them the noise may be likelier.
    """
    near = sorted((one for one in found if one[0] > least), key=lambda one: -one[0])
    return [members for _, members in near if members not in known][:1]


def _in_place(board: Board[E], ranked: Sequence[tuple[float, NoiseModel, Members]]) -> list[tuple[float, Members]]:
    """Look for a few effects where a term of the likeliest noise may stand for them.

    Returns
    -------
    list of (float, tuple of (int, int))
        Log posterior and effects.
    """
    _, likeliest, members = ranked[0]
    out = []
    for noise in board.instead_of(likeliest, [noise for _, noise, _ in ranked]):
        offset, data = board.data(noise)
        gain, found = best_from(data, members, of_two=False, most=len(members) + _IN_PLACE)
        out.append((offset + gain, found))
    return out


def _add(known: list[tuple[float, NoiseModel, Members]], score: float, noise: NoiseModel, members: Members) -> None:
    """Add a noise to those that are known; of two that are nearly the same the likelier one stays."""
    for place, (old, other, _) in enumerate(known):
        if same_noise(noise, other):
            if score > old:
                known[place] = (score, noise, members)
            return
    known.append((score, noise, members))


def without_drifts(board: Board[E], members: Members) -> Members:
    """Leave out what noise with a memory may imitate."""
    return tuple(m for m, family in zip(members, _drifts(board, members), strict=True) if not family)


def _without_a_family(board: Board[E], members: Members) -> list[Members]:
    """Leave out each family of what noise may imitate by itself, where there are several.

    Ramps of two gyros are a random walk beside a bias that settles after each turn; without that, too, another kind of
    noise stands for all.
    """
    of_drift = _drifts(board, members)
    families = list(dict.fromkeys(family for family in of_drift if family))
    return [
        tuple(m for m, family in zip(members, of_drift, strict=True) if family != one)
        for one in (families if len(families) > 1 else [])
    ]


def _drifts(board: Board[E], members: Members) -> list[str]:
    """Family of each member that noise with a memory may imitate; nothing for the others."""
    first = len(board.evidence.weight)
    candidates = [board.evidence.candidates[column - first] for column in board.columns(members)]
    return [
        c.family if c.effect.bias_drift or c.effect.wander_like or c.effect.scope == "recording" else ""
        for c in candidates
    ]
