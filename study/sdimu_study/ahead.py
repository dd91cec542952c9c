"""Did the search miss the truth? The model that holds what is hidden, scored beside the best one that was found."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from sdimu_calibration.core.posterior.models import Data, Members
from sdimu_calibration.core.posterior.posterior import Posterior
from sdimu_calibration.core.posterior.prior import WIDTHS

MISSED = 1.5
"""Log posterior (1) of the truth over the best model found from which the search missed it: less is a finer step."""
_NOISES = 4
"""Number of noises beside what is hidden that are looked at (1): the likeliest."""


def ahead(found: Posterior[Any], hidden: Sequence[str]) -> float:
    """Log posterior of the model of what is hidden over the best one found.

    The model has those of the hidden effects that gain, each in its likeliest variant and width, in the best noise that
    was found or in one of the likeliest beside these effects.

    Parameters
    ----------
    hidden : sequence of str
        Parameters of hidden effects; those of which nothing can be seen are left out.

    Returns
    -------
    float
        (1); beyond `MISSED` the search missed a better model.
    """
    board, best = found.board, found.best
    variants: dict[str, list[int]] = {}
    for number in range(len(board.use)):
        variants.setdefault(found.candidate(number).parameter.name, []).append(number)
    places = [variants[name] for name in hidden if name in variants]
    members: Members = ()
    top, noises = -np.inf, [best.noise]
    for _ in range(2):
        for noise in noises:
            offset, data = board.data(noise)
            score, there = _holding(data, places)
            if offset + score > top:
                top, members = offset + score, there
        noises = [noise for _, noise in board.as_stated.noises(members)][:_NOISES]
    offset, data = board.data(best.noise)
    return float(top - offset - data.at(best.members).score)


def _holding(data: Data, places: Sequence[Sequence[int]]) -> tuple[float, Members]:
    """Best model of one variant of each parameter, without those that gain nothing."""
    members: Members = ()
    for variants in [*places, *places]:
        others = tuple(member for member in members if member[0] not in variants)
        more = [(number, width) for number in variants for width in range(len(WIDTHS))]
        trials = [tuple(sorted((*others, one))) for one in more]
        members = max((data.at(one).of_any_sign, one) for one in trials)[1]
    while members:
        fewer = max((data.at(one).score, one) for one in (members[:k] + members[k + 1 :] for k in range(len(members))))
        if not fewer[0] > data.at(members).score:
            break
        members = fewer[1]
    return data.at(members).score, members
