"""Noise and effects in turn: an effect that noise stands for is weighed beside the noise that goes with it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from bare_prior import prior

from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.posterior.climb import _without_a_family, climbed
from sdimu_calibration.core.posterior.models import Data
from sdimu_calibration.core.posterior.noise_models import NoiseModel
from sdimu_calibration.core.posterior.search import WINDOW, best_from, window

WHITE = NoiseModel()
WIDE = NoiseModel((NoiseTerm("accel", "flicker", size=1.0),), (-1.0,))
NARROW = NoiseModel((NoiseTerm("accel", "flicker", size=0.5),), (-1.0,))
LIKE_AN_EFFECT = NoiseModel((WIDE.terms[0], NoiseTerm("accel", "rate", size=5.0)), (-1.0, -4.0))
WALK = NoiseModel((NoiseTerm("gyro", "random_walk", size=1.0),), (-1.0,))


class Board:
    """One effect. Beside it noise wanders half as much, and needs no term that follows the rate.

    `levels` of each noise: log posterior of no effect in it, and how strongly the effect shows.
    """

    has_noises = True
    evidence = SimpleNamespace(
        weight=np.zeros(0),
        candidates=[SimpleNamespace(effect=SimpleNamespace(bias_drift=False, wander_like=False, scope="unit"))] * 3,
    )

    def __init__(self, walk=False):
        self.levels = {WHITE: (0.0, 0.0), WIDE: (900.0, 4.0), LIKE_AN_EFFECT: (932.0, 0.0), NARROW: (890.0, 10.0)}
        self.levels[WALK] = (905.0, 10.0)
        self.beside_none = [(932.0, LIKE_AN_EFFECT), (900.0, WIDE)]
        self.walk, self.asked, self.instead, self.of_known = walk, [], [], []

    def data(self, noise):
        offset, pull = self.levels[noise]
        return offset, Data(np.diag([1.0, 0.0, 0.0]), np.array([pull * 1.5, 0.0, 0.0]), prior(3))

    def columns(self, members):
        return [k for k, _ in members]

    def instead_of(self, likeliest, others):
        return self.instead if likeliest == LIKE_AN_EFFECT and WIDE in others else []

    def gain(self, noise):
        """Log posterior of the effect over that of none."""
        return best_from(self.data(noise)[1], ())[0]

    def noises(self, members, tried=None, _rival=0.0, brief=False):
        self.asked.append(members)
        assert not (brief and tried is None), "all kinds are looked for with others in the place of what is found"
        if tried is not None:
            self.of_known.append((members, brief))
        if not members:
            return self.beside_none
        found = [(self.levels[NARROW][0] + self.gain(NARROW), NARROW)]
        if self.walk and (tried is None or any(t.kind == "random_walk" for t in tried)):
            found.insert(0, (self.levels[WALK][0] + self.gain(WALK), WALK))
        return found


def test_an_effect_is_looked_for_without_the_noise_that_stands_for_it():
    """In white noise it does not show, and wide noise alone is too far behind for effects to be looked for in it."""
    board = Board()
    board.levels[WIDE] = (900.0, 10.0)
    # Effects are looked for in noises within 15 of the best one, and in this.
    assert board.levels[LIKE_AN_EFFECT][0] - board.levels[WIDE][0] > 15.0
    noises, ends, _ = climbed(board, [()])
    assert noises[0] in {WIDE, NARROW}
    assert [k for k, _ in ends[0]] == [0]


def test_an_effect_a_little_behind_noise_that_stands_for_it_is_weighed_in_noise_of_its_own():
    board = Board()
    board.levels[WIDE] = (900.0, 5.5)
    assert 0.0 < board.levels[LIKE_AN_EFFECT][0] - board.levels[WIDE][0] - board.gain(WIDE) < WINDOW
    noises, ends, _ = climbed(board, [()])
    assert any(members for members in board.asked)
    assert noises[0] == NARROW
    assert [k for k, _ in ends[0]] == [0]


def test_beside_what_turns_out_best_every_kind_of_noise_was_looked_for():
    """Asked as a rival it was asked of the kinds alone that were known then."""
    board = Board(walk=True)
    board.levels[WIDE] = (900.0, 5.5)
    noises, ends, beside = climbed(board, [()])
    assert noises[0] == WALK
    assert [k for k, _ in ends[0]] == [0]
    assert WALK in [noise for _, noise in beside]
    # The first time as a rival, and whole; then briefly, before all kinds are looked for.
    assert [brief for members, brief in board.of_known if members == ends[0]] == [False, True]


def test_an_effect_that_is_as_likely_as_noise_is_in_the_window_with_its_noise():
    board = Board()
    as_likely = board.levels[NARROW][0] + board.gain(NARROW) + 0.3
    board.levels[LIKE_AN_EFFECT] = (as_likely, 0.0)
    board.levels[WIDE] = (887.0, board.levels[NARROW][1])
    board.beside_none = [(as_likely, LIKE_AN_EFFECT), (887.0, WIDE)]
    noises, ends, _ = climbed(board, [()])
    assert noises[0] == LIKE_AN_EFFECT
    data = [board.data(noise) for noise in noises]
    found = window([d for _, d in data], [offset for offset, _ in data], ends)
    # No move leads from nothing in the one noise to the effect in the other: it must be a start.
    of_effect = [score for (number, members), score in found.items() if noises[number] == NARROW and members]
    assert max(of_effect) == pytest.approx(as_likely - 0.3)
    assert not any(noises[number] == WIDE and not members for number, members in found)


def test_an_effect_that_shows_in_none_of_the_noises_beside_nothing_is_looked_for_without_each_term():
    """Wide noise has taken up the effect; beside the term that follows the rate it is narrower."""
    board = Board()
    board.levels[WIDE] = (900.0, 0.0)
    assert climbed(board, [()])[1] == [()]
    board.instead = [NARROW]
    board.levels[NARROW] = (890.0, 11.0)
    assert board.levels[NARROW][0] + board.gain(NARROW) - board.levels[LIKE_AN_EFFECT][0] > WINDOW
    noises, ends, _ = climbed(board, [()])
    assert noises[0] == NARROW
    assert [k for k, _ in ends[0]] == [0]


class Drifting(Board):
    """Two ramps and a bias that settles, all seen in white noise; a random walk that stands for the ramps alone."""

    evidence = SimpleNamespace(
        weight=np.zeros(0),
        candidates=[
            SimpleNamespace(
                family=family, effect=SimpleNamespace(bias_drift=family != "ramp", wander_like=True, scope="unit")
            )
            for family in ("ramp", "ramp", "settling")
        ],
    )

    def data(self, noise):
        offset, pull = (0.0, np.full(3, 8.0)) if noise == WHITE else (70.0, np.array([0.0, 0.0, 8.0]))
        return offset, Data(np.eye(3), pull, prior(3))

    def instead_of(self, _likeliest, _others):
        return []

    def noises(self, members, _tried=None, _rival=0.0, brief=False):  # noqa: ARG002
        offset, noise = (70.0, WALK) if [k for k, _ in members] == [2] else (0.0, WHITE)
        return [(offset + self.data(noise)[1].at(members).score, noise)]


def test_noise_is_looked_for_without_each_family_of_what_it_may_imitate():
    board = Drifting()
    white = best_from(board.data(WHITE)[1], ())
    assert [k for k, _ in white[1]] == [0, 1, 2]
    assert 70.0 + best_from(board.data(WALK)[1], ())[0] > white[0]
    noises, ends, _ = climbed(board, [()])
    assert noises[0] == WALK
    assert [k for k, _ in ends[0]] == [2]
    # Of one family alone there is no other choice than all.
    assert _without_a_family(board, ((0, 0), (1, 0))) == []
    assert _without_a_family(board, ((0, 0), (2, 1))) == [((2, 1),), ((0, 0),)]
