"""The score of a model and of all its neighbours, in closed form.

With the coefficients taken out, and in units of the prior sizes, the data hold the information J, d on the candidates.
For a set S of them with sizes N(0, w^2) the log posterior over that of the empty set is

    1/2 d_S'(J_S + L)^-1 d_S - 1/2 log det(I + L^-1 J_S) + log pi(S),   L = diag(w^-2)

One inverse of k x k, A = J_S + L, gives every neighbour: what is added, dropped or exchanged changes it by a rank of
one.
"""

from __future__ import annotations

from bisect import bisect
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.posterior.neighbours import additions
from sdimu_calibration.core.posterior.pairs import best_pair
from sdimu_calibration.core.posterior.prior import KIN, WIDTH_SHARES, WIDTHS, Prior

Member = tuple[int, int]
"""A candidate in a model, and which of `WIDTHS` its size has."""
Members = tuple[Member, ...]
"""Of a model, in ascending order."""
_PRECISION = np.array(WIDTHS) ** -2.0
"""Prior information (1) on a size of each width: sizes are in units of the prior's."""
_LOG_SHARE = np.log(WIDTH_SHARES)
_ROUNDING = 1e-9
"""Size in units of the prior's (1) below which a negative one is zero: the rounding of an inverse."""
_FIRST = 60
"""Number of candidates (1) of which one is in a pair that stands in the place of two: what two others together are
shows in one of the pair at least, and all pairs take ten times as long."""
_WIDTHS = np.column_stack([_PRECISION, _LOG_SHARE])


@dataclass(frozen=True)
class Data:
    """Information on q candidates in one noise, the coefficients taken out, in units of the prior sizes."""

    J: Floats
    """Shape (q, q)."""
    d: Floats
    """Shape (q,)."""
    prior: Prior

    def at(self, members: Members) -> Expansion:
        """Score a model and its neighbours."""
        return Expansion(self, members)


class Expansion:
    """A model, and what it takes to score its neighbours.

    Attributes
    ----------
    score : float
        Log posterior over that of the empty set in the same noise; -inf of a model with a size of the wrong sign.
    of_any_sign : float
        The same, whatever the signs of the sizes.
    c, r : ndarray, shape (q,)
        Information on each candidate beside the model, and its pull.
    """

    def __init__(self, data: Data, members: Members) -> None:
        self.data, self.members = data, members
        self.columns = [column for column, _ in members]
        J, d = data.J, data.d
        loading = _PRECISION[[width for _, width in members]] if members else np.empty(0)
        self._loading = loading
        B = J[:, self.columns]
        A = B[self.columns] + np.diag(loading)
        self._inverse = np.linalg.inv(A) if members else np.zeros((0, 0))
        self._m = self._inverse @ d[self.columns]
        self._V = B @ self._inverse
        self.c = np.maximum(np.diag(J) - np.einsum("qk,qk->q", self._V, B), 0.0)
        self.r = d - B @ self._m
        log_det = float(np.linalg.slogdet(A)[1]) if members else 0.0
        self.score = self.of_any_sign = (
            0.5 * float(d[self.columns] @ self._m)
            - 0.5 * (log_det - float(np.log(loading).sum()))
            + self._log_prior(members)
        )
        # A size that cannot be negative and comes out negative: no model.
        if np.any(data.prior.positive[self.columns] & (self._m < 0.0)):
            self.score = -np.inf

    @property
    def sizes(self) -> Floats:
        """Posterior means of the sizes, in units of the prior sizes; shape (k,)."""
        return self._m

    @property
    def variances(self) -> Floats:
        """Posterior variances of the sizes, in squares of the prior sizes.

        Returns
        -------
        ndarray, shape (k,)
            (1).
        """
        return np.diag(self._inverse)

    def gains(self) -> Floats:
        """Log posterior that each candidate adds, by width.

        Returns
        -------
        ndarray, shape (q, widths)
            (1).
        """
        return gains(self.c, self.r, self.data.prior.positive) + self.data.prior.log_more(self.columns)[:, None]

    def stands(self, sizes: Floats) -> Bools:
        """Whether members that cannot be negative stay so beside each candidate.

        Parameters
        ----------
        sizes : ndarray, shape (q, widths)
            Of the candidates, in units of their prior sizes.

        Returns
        -------
        ndarray of bool, shape (q, widths)
        """
        out = np.ones(sizes.shape, dtype=bool)
        for place in np.flatnonzero(self.data.prior.positive[self.columns]).tolist():
            out &= self._m[place] - self._V[:, place, None] * sizes >= 0.0
        return out

    def drops(self) -> Floats:
        """Log posterior that the model gains without each of its members.

        Returns
        -------
        ndarray, shape (k,)
            (1).
        """
        a = np.diag(self._inverse)
        out = -0.5 * self._m**2 / a - 0.5 * np.log(a * self._loading)
        for k, (column, width) in enumerate(self.members):
            out[k] -= _LOG_SHARE[width] + self.data.prior.log_more(self._without(k))[column]
        return np.asarray(out)

    def exchanges(self) -> Iterator[tuple[int, Floats]]:
        """Log posterior that another candidate gains in the place of each member.

        Returns
        -------
        iterator of (int, ndarray)
            Place of the member, and the gains, shape (q, widths) (1).
        """
        drops = self.drops()
        for k in range(len(self.members)):
            table = gains(*self._freed(k), self.data.prior.positive)
            yield k, table + (self.data.prior.log_more(self._without(k)) + drops[k])[:, None]

    def neighbours(self, least: float) -> Iterator[tuple[float, Members]]:
        """Give the models one move away whose log posterior exceeds `least`: what is added, dropped, exchanged."""
        more = least - self.score
        for column, width, gain in self._above(self.c, self.r, self.data.prior.log_more(self.columns), more):
            yield self.score + gain, _with(self.members, column, width)
        drops = self.drops()
        for k, without in enumerate(drops.tolist()):
            others = self.members[:k] + self.members[k + 1 :]
            if without > more:
                yield self.score + without, others
            odds = self.data.prior.log_more(self._without(k))
            for column, width, gain in self._above(*self._freed(k), odds, more - without):
                yield self.score + without + gain, _with(others, column, width)

    def _freed(self, place: int) -> tuple[Floats, Floats]:
        """Information on each candidate, and its pull, beside the model without one of its members."""
        a, v = self._inverse[place, place], self._V[:, place]
        return self.c + v * v / a, self.r + v * (self._m[place] / a)

    def _above(self, c: Floats, r: Floats, odds: Floats, least: float) -> Iterator[tuple[int, int, float]]:
        """Candidates, widths and gains above a limit."""
        found = additions(np.column_stack([c, r]), odds, self.data.prior.positive, _WIDTHS, least)
        return zip(*(part.tolist() for part in found), strict=True)

    def mergers(self) -> Iterator[tuple[Members, Floats]]:
        """Log posterior with another candidate in the place of two members.

        Returns
        -------
        iterator of (tuple of (int, int), ndarray)
            The members that stay, and the log posterior of each model, shape (q, widths) (1).
        """
        positive = self.data.prior.positive
        for i, j in combinations(range(len(self.members)), 2):
            pair, others = [i, j], tuple(m for k, m in enumerate(self.members) if k not in (i, j))
            inverse, V, m = self._inverse[np.ix_(pair, pair)], self._V[:, pair], self._m[pair]
            own = np.linalg.inv(inverse)
            if np.any(positive[self.columns] & (self._m - self._inverse[:, pair] @ (own @ m) < -_ROUNDING)):
                continue
            table = gains(self.c + np.einsum("qa,ab,qb->q", V, own, V), self.r + V @ (own @ m), positive)
            table += self.data.prior.log_more([column for column, _ in others])[:, None]
            there = -0.5 * float(m @ own @ m) - 0.5 * float(np.log(np.linalg.det(inverse) * self._loading[pair].prod()))
            yield others, table + (self.score + there + self._log_prior(others) - self._log_prior(self.members))

    def merged(self) -> tuple[float, Members]:
        """Put the best candidate in the place of two members: log posterior of the model, and the model."""
        best, at = -np.inf, self.members
        for others, table in self.mergers():
            column, width = np.unravel_index(int(np.argmax(table)), table.shape)
            if table[column, width] > best:
                best, at = float(table[column, width]), _with(others, int(column), int(width))
        return best, at

    def _log_prior(self, members: Members) -> float:
        columns = [column for column, _ in members]
        return float(sum(_LOG_SHARE[width] for _, width in members)) + self.data.prior.log_of(columns)

    def paired(self, instead: Sequence[int] = ()) -> tuple[float, Members]:
        """Add the best two candidates at once: log posterior of the model, and the model.

        Parameters
        ----------
        instead : sequence of int
            Candidates in whose place the two stand: neither is one that no model has beside them. One of the two must
            then be among the `_FIRST` that alone add most. Whether what stays in the model keeps its sign is not seen.
        """
        J, prior = self.data.J, self.data.prior
        more = prior.log_more(self.columns)
        # Odds of the second beside the first: k + 2 over k + 1, and its kin.
        step = np.log((prior.named(self.columns) + 2.0) / (prior.named(self.columns) + 1.0))
        # Two equations that no physics names are too many.
        use = np.flatnonzero(np.isfinite(more) & (self.c > 0.0) & ~prior.own & ~prior.like(instead))
        if len(use) < 2:
            return -np.inf, self.members
        first = len(use)
        if instead:
            alone = gains(self.c[use], self.r[use], prior.positive[use]).max(axis=1) + more[use]
            use, first = use[np.argsort(-alone)], min(first, _FIRST)
        X = J[np.ix_(use[:first], use)] - self._V[use[:first]] @ J[self.columns][:, use]
        table = np.column_stack([self.c[use], self.r[use], more[use], prior.positive[use]])
        apart, kin = prior.apart(self.columns, use)
        gain, i, j, width = best_pair(np.ascontiguousarray(X), table, apart, kin, _WIDTHS, KIN)
        members = _with(_with(self.members, int(use[i]), width), int(use[j]), width)
        return self.score + gain + float(step), members

    def _without(self, place: int) -> list[int]:
        return [column for k, column in enumerate(self.columns) if k != place]


def gains(c: Floats, r: Floats, positive: Bools) -> Floats:
    """Log Bayes factor of each candidate, by the width of its size.

    Parameters
    ----------
    c, r : ndarray, shape (q,)
        Information on each candidate beside a model, and its pull, in units of the prior sizes.
    positive : ndarray of bool, shape (q,)
        Whose size cannot be negative.

    Returns
    -------
    ndarray, shape (q, widths)
        With the share of each width (1); -inf for a size of the wrong sign.
    """
    a = c[:, None] + _PRECISION
    out = 0.5 * (r * r)[:, None] / a - 0.5 * np.log(a / _PRECISION) + _LOG_SHARE
    out[positive & (r < 0.0)] = -np.inf
    return np.asarray(out)


def _with(members: Members, column: int, width: int) -> Members:
    place = bisect(members, (column, width))
    return (*members[:place], (column, width), *members[place:])
