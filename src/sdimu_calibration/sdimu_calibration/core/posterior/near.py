"""Which of very many more candidates a search could bring into a model: the others need not be weighed.

A thousand equations that no physics names cost more than the rest of a search, and nearly all of them are far from
every model. The closed form of the neighbours of a model says which are near before their information is worked out.

Source: J. Fan, J. Lv, "Sure independence screening for ultrahigh dimensional feature space", J. Royal Statistical
Society B 70 (2008).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.evidence.candidate import Candidate
from sdimu_calibration.core.evidence.information import solved
from sdimu_calibration.core.evidence.linear import E, candidate_priors
from sdimu_calibration.core.posterior.board import Board
from sdimu_calibration.core.posterior.climb import without_drifts
from sdimu_calibration.core.posterior.models import Data, Expansion, Members, gains
from sdimu_calibration.core.posterior.noise_models import NoiseModel
from sdimu_calibration.core.posterior.posterior import Posterior
from sdimu_calibration.core.posterior.prior import UNKNOWN_SIZE, Prior, prior_of
from sdimu_calibration.core.posterior.search import WINDOW

_BEHIND = WINDOW + 3.0
"""Log posterior (1) behind the best model up to which a candidate is kept: the window, and what a sine midway between
two of the scan gains when it is made finer."""
_FIRST = 0.5
"""Share of what the best candidate explains beside nothing (1) from which one is kept: a search from nothing may begin
with it."""
_LIKELY = 0.02
"""Probability of a noise (1) from which candidates are held against the models in it: less would not change what is
told."""


def near(found: Posterior[E], effects: Sequence[Effect], signature: Floats) -> Bools:
    """Say which of very many effects a move brings near the best model.

    Moves are those of the search from the best model and from the one that is told: one more, one in the place of a
    member, one in the place of two. Kept is also what beside nothing, or beside what is no drift, explains half as much
    as the best candidate does.

    Parameters
    ----------
    found : Posterior
        Of all other candidates.
    effects : sequence of Effect, length n
        Of one parameter each.
    signature : ndarray, shape (N, n)
        Of these (whitened residual per SI unit).

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    board, W = found.board, signature
    candidates, size = candidate_priors(effects, board.evidence.imu)
    models = list(dict.fromkeys([found.best.members, found.told.members]))
    beside = list(dict.fromkeys([(), *(without_drifts(board, one) for one in models)]))
    likely = [found.best.noise, found.told.noise, *(noise for noise, p in found.noises if p > _LIKELY)]
    best = max(offset + data.at(one).score for offset, data in map(board.data, likely) for one in models)
    prior = _prior(board, candidates)
    on_wander = None if board.wander is None else board.wander.U.across(W)
    keep = np.zeros(len(candidates), dtype=bool)
    for noise in dict.fromkeys([NoiseModel(), *likely]):
        offset, every = board.data(noise)
        more = _beside(board, noise, W, on_wander, size, prior, models)
        for members in models:
            keep |= offset + more.moved(members) > best - _BEHIND
        for members in beside:
            keep |= more.begins(members, _FIRST * _explained(every.at(members)).max(initial=0.0))
    return keep


@dataclass(frozen=True)
class _More:
    """Members of some models, then n candidates more, in one noise."""

    data: Data
    """Without information across the candidates: no model has two of them."""
    place: Mapping[int, int]
    """Of each member among the candidates of the board."""

    def at(self, members: Members) -> Expansion:
        return self.data.at(tuple((self.place[number], width) for number, width in members))

    def moved(self, members: Members) -> Floats:
        """Best log posterior of a model with each candidate, one move away (1); shape (n,)."""
        here, first = self.at(members), len(self.place)
        # A size that has the wrong sign in this noise may have the right one beside what comes in.
        tables = [here.of_any_sign + here.gains(), *(here.of_any_sign + table for _, table in here.exchanges())]
        tables += [table for _, table in here.mergers()]
        # What rounding leaves of a pair that is nearly one is no number, and says nothing.
        return np.asarray(np.nanmax(tables, axis=(0, 2))[first:])

    def begins(self, members: Members, least: float) -> Bools:
        """Whether each candidate beside a model explains as much, as log Bayes factor (1), and is no worse than it."""
        here, first = self.at(members), len(self.place)
        return np.asarray((_explained(here) > least)[first:] & (here.gains().max(axis=1) > -_BEHIND)[first:])


def _explained(here: Expansion) -> Floats:
    return np.asarray(gains(here.c, here.r, here.data.prior.positive).max(axis=1))


def _beside(
    board: Board[E],
    noise: NoiseModel,
    W: Floats,
    on_wander: Floats | None,
    size: Floats,
    prior: Prior,
    models: Sequence[Members],
) -> _More:
    """Put the members of models and n candidates of signatures W (N, n) together in a noise.

    `on_wander` is as for `Board.seen_of`; `size` (n,) is the one-sigma size of the candidates (SI), inf where unknown;
    `prior` is that of all candidates of the board and of these.
    """
    numbers = sorted({number for one in models for number, _ in one})
    k, p = len(numbers), len(board.evidence.weight)
    one, known = board.in_noise(noise), board.data(noise)[1]
    at = np.array([*range(p), *(p + number for number in numbers)], dtype=np.int64)
    own, across, d = board.seen_of(W, at, noise, on_wander)
    X = solved(one.J[:p, :p] + np.diag(board.evidence.weight), np.column_stack([across[:, :p].T, one.d[:p]]))
    c = own - np.einsum("ik,ki->i", across[:, :p], X[:, :-1])
    in_white = np.einsum("ij,ij->j", W, W)
    size = np.where(np.isfinite(size), size, UNKNOWN_SIZE / np.sqrt(np.maximum(in_white, 1e-300)))
    between = (across[:, p:] - X[:, :-1].T @ one.J[:p, [p + number for number in numbers]]) * board.size[numbers]
    J = np.diag(np.concatenate([np.zeros(k), np.maximum(c, 0.0) * size**2]))
    J[:k, :k] = known.J[np.ix_(numbers, numbers)]
    J[k:, :k] = between * size[:, None]
    J[:k, k:] = J[k:, :k].T
    pull = np.concatenate([known.d[numbers], (d - across[:, :p] @ X[:, -1]) * size])
    places = np.array([*numbers, *range(len(board.use), len(board.use) + len(c))], dtype=np.int64)
    return _More(Data(J, pull, prior.of(places)), {number: place for place, number in enumerate(numbers)})


def _prior(board: Board[E], candidates: Sequence[Candidate]) -> Prior:
    """Prior of all candidates of a board, then of more."""
    columns = board.use.tolist()
    every = [board.evidence.candidate(column) for column in columns]
    return prior_of(
        [*every, *candidates],
        [place for place, column in enumerate(columns) if column in board.finer],
        found=board.evidence.found,
    )
