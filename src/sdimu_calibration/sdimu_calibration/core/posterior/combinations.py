"""Two effects that together are a third one, and two that together are two others.

By ``|a| = 1`` at rest a quadratic term and a cross term are another cross term beside a bias. Delays of two of three
accelerometers that are nearly alike are a delay of the triad beside the opposite one of the third. A search that
exchanges one at a time does not cross from one side to the other.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from sdimu_calibration.core.posterior.models import Data, Members
from sdimu_calibration.core.posterior.prior import WIDTHS

_SAME = 1e-3
"""Share of a signature (1) that two others together may leave for them to be it: of an effect of 30 sigma less than one
sigma; what is no identity leaves some percent."""
_ONE = 1e-2
"""Share of a signature (1) that one other must leave: with less that one alone is a look-alike."""
_MOST = 6
"""Number of pairs of an effect that are kept, the closest first: more than an identity or two has none."""


def combinations_of(data: Data, number: int) -> list[tuple[int, int]]:
    """Find the pairs of candidates that show as one does, to rounding.

    Parameters
    ----------
    number : int
        The candidate.
    """
    J = data.J
    size = np.sqrt(np.maximum(np.diag(J), 1e-300))
    C = J / np.outer(size, size)
    c, fit = C[number], 1.0 - C**2
    usable = c * c < 1.0 - _ONE
    with np.errstate(divide="ignore", invalid="ignore"):
        left = 1.0 - (c[:, None] ** 2 + c[None, :] ** 2 - 2.0 * np.outer(c, c) * C) / fit
    left[~(usable[:, None] & usable[None, :] & (fit > _ONE))] = 1.0
    left[data.prior.own, :] = left[:, data.prior.own] = 1.0
    rows, columns = np.nonzero(np.triu(left < _SAME))
    order = np.argsort(left[rows, columns])[:_MOST]
    return list(zip(rows[order].tolist(), columns[order].tolist(), strict=True))


def crossed(data: Data, members: Members) -> list[Members]:
    """Give the models that have a pair in the place of a member that it shows as, each with its best widths.

    Parameters
    ----------
    members : tuple of (int, int)
        A model.
    """
    have = {number for number, _ in members}
    widths = range(len(WIDTHS))
    out: list[Members] = []
    for place, (number, _) in enumerate(members):
        others = members[:place] + members[place + 1 :]
        for first, second in combinations_of(data, number):
            if {first, second} & have:
                continue
            trials = [tuple(sorted((*others, (first, a), (second, b)))) for a in widths for b in widths]
            score, best = max((data.at(one).score, one) for one in trials)
            if np.isfinite(score):
                out.append(best)
    return out


def exchanged(data: Data, members: Members, least: float) -> list[Members]:
    """Give the models that have the best two others in the place of two members.

    Parameters
    ----------
    members : tuple of (int, int)
        A model.
    least : float
        Log posterior, over that of the empty set in the same noise, that they exceed (1).
    """
    out: list[Members] = []
    for two in combinations(members, 2):
        others = tuple(member for member in members if member not in two)
        score, found = data.at(others).paired([number for number, _ in two])
        if score > least:
            out.append(found)
    return out
