"""The best model, and every model near it: climb, then Occam's window.

The climb takes the best move until none helps: add, drop, exchange one; then two at once, or one in the place of two.
The window holds every model within `WINDOW` of the best that one move reaches from another one in it.

Sources: D. Madigan, A. Raftery, "Model selection and accounting for model uncertainty in graphical models using Occam's
window", JASA 89 (1994); C. Hans, A. Dobra, M. West, "Shotgun stochastic search", JASA 102 (2007).
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from math import exp

import numpy as np

from sdimu_calibration.core.posterior.models import Data, Expansion, Members

WINDOW = 7.0
"""Log posterior (1) behind the best model up to which a model is in the window: a thousandth of its probability."""
MOST_EXPANDED = 300
"""Number of models of a window whose neighbours are looked at, the likeliest first: beyond, each weighs so
little that shares stay the same to a hundredth."""
_EXPANDED = 0.999
"""Share of the probability of all models found (1) whose neighbours are looked at: those of the rest
weigh less still."""
_LARGEST = 600.0
"""Log of a weight (1) from which it counts no further: e to the 709 is the largest number."""
MOST_EFFECTS = 40
"""Number of effects of a model at most: more than any sensor that is worth a calibration has."""
_LEAST_GAIN = 1e-6
"""Log posterior (1) that a move must gain: less is rounding, and would go round in circles."""


def best_from(data: Data, start: Members, of_two: bool = True, most: int = MOST_EFFECTS) -> tuple[float, Members]:
    """Climb from a model to the best one that moves lead to.

    Parameters
    ----------
    start : tuple of (int, int)
        Model to begin with.
    of_two : bool
        Also moves of two members at once.
    most : int
        Number of members to stop at.

    Returns
    -------
    score : float
        Log posterior over that of the empty set in the same noise (1).
    members : tuple of (int, int)
    """
    here = data.at(start)
    while len(here.members) < most:
        score, members = _best_neighbour(here)
        if of_two and not score > here.score + _LEAST_GAIN:
            score, members = _of_two(here)
        if not score > here.score + _LEAST_GAIN:
            break
        there = data.at(members)
        # Columns that are nearly one another's combination leave a difference of large numbers: no move on rounding.
        if not there.score > here.score:
            break
        here = there
    return here.score, here.members


def _best_neighbour(here: Expansion) -> tuple[float, Members]:
    return max(_tops(here), key=lambda found: found[0], default=(-np.inf, here.members))


def _tops(here: Expansion) -> list[tuple[float, Members]]:
    """Best addition, best drop, best exchange in each place."""
    out = []
    gains = here.gains()
    if gains.size:
        column, width = (int(i) for i in np.unravel_index(int(np.argmax(gains)), gains.shape))
        out.append((here.score + float(gains[column, width]), tuple(sorted((*here.members, (column, width))))))
    for k, gain in enumerate(here.drops().tolist()):
        out.append((here.score + gain, here.members[:k] + here.members[k + 1 :]))
    for k, table in here.exchanges():
        column, width = (int(i) for i in np.unravel_index(int(np.argmax(table)), table.shape))
        others = here.members[:k] + here.members[k + 1 :]
        out.append((here.score + float(table[column, width]), tuple(sorted((*others, (column, width))))))
    return out


def _of_two(here: Expansion) -> tuple[float, Members]:
    """Two candidates at once, beside the model or in the place of one member; one in the place of two."""
    fewer = [here.data.at(here.members[:k] + here.members[k + 1 :]) for k in range(len(here.members))]
    return max((here.paired(), here.merged(), *(one.paired() for one in fewer)), key=lambda found: found[0])


def window(
    data: Sequence[Data], offset: Sequence[float], starts: Sequence[Members]
) -> dict[tuple[int, Members], float]:
    """Collect the models near the best one, over several noises.

    Parameters
    ----------
    data : sequence of Data
        One a noise.
    offset : sequence of float
        Log posterior of the empty set in each (1).
    starts : sequence of tuple of (int, int)
        Models to begin with, tried in every noise.

    Returns
    -------
    dict of (int, members) to float
        Log posterior of each model, by the number of its noise.
    """
    found: dict[tuple[int, Members], float] = {}
    for number, one in enumerate(data):
        for members in {*starts, ()}:
            found[number, members] = offset[number] + one.at(members).score
    waiting = [(-score, key) for key, score in found.items()]
    heapq.heapify(waiting)
    best, expanded = max(found.values()), 0
    first, done = best, 0.0
    total = sum(_weight(score - first) for score in found.values())
    while waiting and expanded < MOST_EXPANDED and done < _EXPANDED * total:
        score, (number, members) = heapq.heappop(waiting)
        if -score < best - WINDOW:
            break
        if not _holds(data[number], members):
            continue
        expanded += 1
        done += _weight(-score - first)
        for other, near in data[number].at(members).neighbours(best - WINDOW - offset[number]):
            key = (number, near)
            if key not in found:
                found[key] = offset[number] + other
                total += _weight(found[key] - first)
                heapq.heappush(waiting, (-found[key], key))
                best = max(best, found[key])
    ranked = sorted(found.items(), key=lambda item: -item[1])
    kept: dict[tuple[int, Members], float] = {}
    for (number, members), score in ranked:
        # The first one that is a model is the best: what is far behind it need not be looked at.
        if kept and score <= next(iter(kept.values())) - WINDOW:
            break
        if _holds(data[number], members):
            kept[number, members] = score
    return kept


def _weight(score: float) -> float:
    """Weight of a model over that of the first one, as far as a number can hold it."""
    return exp(min(score, _LARGEST))


def _holds(data: Data, members: Members) -> bool:
    """Whether a model is one: of the sizes that cannot be negative none is.

    What enters a model may turn the sign of what is in it already; the closed form of the neighbours does not see that.
    """
    of_one_sign = data.prior.of_one_sign
    return of_one_sign.isdisjoint([number for number, _ in members]) or bool(np.isfinite(data.at(members).score))
