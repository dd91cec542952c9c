"""Columns of many rows that have few directions in each stop, as signatures of wandering biases have.

What a bias did in an earlier stop shows in the rows of a stop by the errors of attitude, velocity and position that it
left, nine numbers; what it does in the stop itself, by one number a stretch and sensor. So the rows of a stop,
thousands of them, are a combination of some dozens of directions, and what is multiplied, divided and left out are
these.

Directions are found by sketches. Source: N. Halko, P. Martinsson, J. Tropp, "Finding structure with randomness", SIAM
Review 53 (2011), algorithm 4.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.evidence.inner_noise import InnerNoise
from sdimu_calibration.core.side_by_side import side_by_side

_LEAST = 1e-9
"""Part of a stop in a column, over the whole column (1), below which it is left out: information loses the square of
it, an estimate as much of its sigma."""
_SKETCHED = 48
"""Number of directions (1) that are looked for at a time: a stop of an hour's test has one to three times as many."""


@dataclass(frozen=True)
class Layout:
    """Which of N rows are of which stop."""

    stop: Ints
    """Number of the stop that each row belongs to, shape (N,)."""

    @cached_property
    def stops(self) -> Ints:
        """Number of each stop, shape (s,)."""
        return np.unique(self.stop).astype(np.int64)

    @cached_property
    def rows(self) -> tuple[Ints, ...]:
        """Rows of each stop, shape (n,) each."""
        return tuple(np.flatnonzero(self.stop == number) for number in self.stops)


@dataclass(frozen=True)
class InStops:
    """Matrix of N rows and c columns: in each stop, directions times what each column has of them."""

    layout: Layout
    """Which rows are of which stop."""
    directions: tuple[Floats, ...]
    """Of each stop, orthonormal, shape (rows, m); stops in the order of their numbers."""
    parts: Floats
    """What each column has of all directions, stop by stop, shape (M, c); in the unit of the columns."""

    @classmethod
    def of(cls, columns: Floats, stop: Ints) -> InStops:
        """Find the directions of columns.

        Parameters
        ----------
        columns : ndarray, shape (N, c)
            In any units.
        stop : ndarray of int, shape (N,)
            Number of the stop that each row belongs to.
        """
        return cls.none(stop).beside(columns)

    @classmethod
    def none(cls, stop: Ints) -> InStops:
        """Give no columns.

        Parameters
        ----------
        stop : ndarray of int, shape (N,)
            Number of the stop that each row belongs to.
        """
        layout = Layout(stop)
        return cls(layout, tuple(np.zeros((len(rows), 0)) for rows in layout.rows), np.zeros((0, 0)))

    @property
    def stops(self) -> Ints:
        """Number of each stop, shape (s,)."""
        return self.layout.stops

    @property
    def rows(self) -> tuple[Ints, ...]:
        """Rows of each stop, shape (n,) each."""
        return self.layout.rows

    @cached_property
    def places(self) -> tuple[slice, ...]:
        """Directions of each stop among all."""
        ends = np.cumsum([0, *(Q.shape[1] for Q in self.directions)]).tolist()
        return tuple(slice(a, b) for a, b in pairwise(ends))

    @cached_property
    def square(self) -> Floats:
        """Products of the columns with each other, shape (c, c)."""
        return np.asarray(self.parts.T @ self.parts)

    def combined(self, weights: Floats) -> InStops:
        """Combine columns.

        Parameters
        ----------
        weights : ndarray, shape (c, k)
            Of each column in each combination.
        """
        return InStops(self.layout, self.directions, self.parts @ weights)

    def only(self, columns: Bools) -> InStops:
        """Return some of the columns.

        Parameters
        ----------
        columns : ndarray of bool, shape (c,)
            Which.
        """
        return InStops(self.layout, self.directions, self.parts[:, columns])

    def seen(self, columns: Floats) -> Floats:
        """Say what other columns have of the directions.

        Parameters
        ----------
        columns : ndarray, shape (N, k)

        Returns
        -------
        ndarray, shape (M, k)
            In their units.
        """
        pairs = zip(self.rows, self.directions, strict=True)
        return np.vstack([np.zeros((0, columns.shape[1])), *(Q.T @ columns[rows] for rows, Q in pairs)])

    def across(self, columns: Floats) -> Floats:
        """Multiply other columns, turned, with these.

        Parameters
        ----------
        columns : ndarray, shape (N, k)

        Returns
        -------
        ndarray, shape (k, c)
        """
        return np.asarray(self.seen(columns).T @ self.parts)

    def times(self, weights: Floats) -> Floats:
        """Give the rows of a combination of the columns.

        Parameters
        ----------
        weights : ndarray, shape (c,) or (c, k)

        Returns
        -------
        ndarray, shape (N,) or (N, k)
        """
        return self.spread(self.parts @ weights)

    def spread(self, parts: Floats) -> Floats:
        """Give the rows of what is known by its directions.

        Parameters
        ----------
        parts : ndarray, shape (M,) or (M, k)

        Returns
        -------
        ndarray, shape (N,) or (N, k)
            In the unit of the parts.
        """
        out = np.zeros((len(self.layout.stop), *parts.shape[1:]))
        for rows, Q, place in zip(self.rows, self.directions, self.places, strict=True):
            out[rows] = Q @ parts[place]
        return out

    def beside(self, columns: Floats) -> InStops:
        """Put columns behind these.

        Parameters
        ----------
        columns : ndarray, shape (N, k)
            In any units.

        Raises
        ------
        ValueError
            Of a column that is not finite.
        """
        length = np.sqrt(np.einsum("ij,ij->j", columns, columns))
        if not np.isfinite(length).all():
            raise ValueError("a column of signatures is not finite")
        unit = 1.0 / np.where(length > 0.0, length, 1.0)

        def extended(known: tuple[Ints, Floats]) -> tuple[Floats, Floats]:
            own = columns[known[0]]
            Q = _more(known[1], own, unit)
            return Q, Q.T @ own

        found = side_by_side(extended, zip(self.rows, self.directions, strict=True))
        old = [self.parts[place] for place in self.places]
        c = self.parts.shape[1]
        width = c + columns.shape[1]
        parts = [np.zeros((Q.shape[1], width)) for Q, _ in found]
        for part, mine, (_, new) in zip(parts, old, found, strict=True):
            part[: len(mine), :c], part[:, c:] = mine, new
        return InStops(self.layout, tuple(Q for Q, _ in found), np.vstack([np.zeros((0, width)), *parts]))

    def whitened(self, inner: InnerNoise) -> InStops:
        """Whiten in noise that moves within stretches."""
        stop = self.layout.stop
        if any(stop[part.rows.start] != stop[part.rows.stop - 1] for part in inner.parts):
            # A rest that two stops share: what it mixes has directions of both.
            return InStops.of(inner.whitened(self.spread(self.parts)), stop)
        every = np.zeros((len(stop), max((Q.shape[1] for Q in self.directions), default=0)))
        for rows, Q in zip(self.rows, self.directions, strict=True):
            every[rows, : Q.shape[1]] = Q
        white = inner.whitened(every)
        parts, directions = np.empty_like(self.parts), []
        for rows, Q, place in zip(self.rows, self.directions, self.places, strict=True):
            turned, R = np.linalg.qr(white[rows, : Q.shape[1]])
            directions.append(turned)
            parts[place] = R @ self.parts[place]
        return InStops(self.layout, tuple(directions), parts)


def _more(known: Floats, columns: Floats, unit: Floats) -> Floats:
    """Find the directions of columns that are not known, behind those that are.

    Parameters
    ----------
    known : ndarray, shape (n, m)
        Orthonormal.
    columns : ndarray, shape (n, k)
    unit : ndarray, shape (k,)
        Length of each column in all stops, inverse.
    """
    # Fixed: the same columns have the same directions.
    rng = np.random.default_rng(0)
    Q, left = known, min(len(columns) - known.shape[1], columns.shape[1])
    while left > 0:
        count = min(_SKETCHED, left)
        fresh = columns @ (unit[:, None] * rng.standard_normal((len(unit), count)))
        fresh -= Q @ (Q.T @ fresh)
        turned, R = np.linalg.qr(fresh)
        seen = np.abs(np.diag(R)) > _LEAST
        # Behind the first direction that is rounding all are.
        some = count if seen.all() else int(np.argmin(seen))
        turned = turned[:, :some]
        # A small part of what is known already is a large one of a direction that was small.
        Q = np.hstack([Q, np.linalg.qr(turned - Q @ (Q.T @ turned))[0]])
        left = left - count if some == count else 0
    return np.ascontiguousarray(Q)
