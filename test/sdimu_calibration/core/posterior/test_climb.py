"""Noise and effects in turn: an effect that noise stands for is weighed beside the noise that goes with it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from bare_prior import prior

from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.posterior.models import Data
from sdimu_calibration.core.posterior.noise_models import NoiseModel
from sdimu_calibration.core.posterior.posterior import climbed
from sdimu_calibration.core.posterior.search import WINDOW, best_from, window

WANDER = NoiseTerm("accel", "flicker", size=1.0)
FOLLOWS = NoiseTerm("accel", "rate", size=5.0)
SMALLER = NoiseTerm("accel", "flicker", size=0.5)
WHITE, WIDE = NoiseModel(), NoiseModel((WANDER,), (-1.0,))
LIKE_AN_EFFECT = NoiseModel((WANDER, FOLLOWS), (-1.0, -4.0))
NARROW = NoiseModel((SMALLER,), (-1.0,))


class Board:
    """One effect; beside it the wandering noise is half as large as beside none, and noise that follows is needless."""

    has_noises = True
    known = prior(3)
    evidence = SimpleNamespace(
        weight=np.zeros(0),
        candidates=[SimpleNamespace(effect=SimpleNamespace(bias_drift=False, wander_like=False, scope="unit"))] * 3,
    )

    def __init__(self):
        # Log posterior of no effect, and what the effect gains in its square.
        self.levels = {WHITE: (0.0, 8.0), WIDE: (900.0, 8.0), LIKE_AN_EFFECT: (932.0, 1.0), NARROW: (890.0, 10.0)}

    def data(self, noise):
        offset, pull = self.levels[noise]
        J = np.diag([1.0, 0.0, 0.0])
        return offset, Data(J, np.array([pull * 1.5, 0.0, 0.0]), self.known)

    def columns(self, members):
        return [k for k, _ in members]

    def noises(self, members, _tried=None, _rival=0.0):
        if not members:
            return [(932.0, LIKE_AN_EFFECT), (900.0, WIDE)]
        return [(890.0 + best_from(self.data(NARROW)[1], ())[0], NARROW)]


def test_an_effect_stands_beside_the_noise_that_it_leaves():
    board = Board()
    noises, ends, _ = climbed(board, [()])
    assert noises[0] == NARROW
    assert [k for k, _ in ends[0]] == [0]


def test_an_effect_that_is_as_likely_as_noise_is_in_the_window_with_its_noise():
    board = Board()
    gain, _ = best_from(board.data(NARROW)[1], ())
    # The two answers are a third apart in the log posterior, the noise first.
    board.levels[LIKE_AN_EFFECT] = (890.0 + gain + 0.3, 0.0)
    board.noises = lambda members, _tried=None, _rival=0.0: (
        [(890.0 + gain, NARROW)] if members else [(890.0 + gain + 0.3, LIKE_AN_EFFECT), (900.0, WIDE)]
    )
    noises, ends, _ = climbed(board, [()])
    assert noises[0] == LIKE_AN_EFFECT
    assert NARROW in noises
    data = [board.data(noise) for noise in noises]
    # No move leads from nothing in the one noise to the effect in the other: it must be a start.
    nothing_in_narrow = board.data(NARROW)[0]
    assert nothing_in_narrow < 890.0 + gain - WINDOW
    found = window([d for _, d in data], [offset for offset, _ in data], ends)
    of_effect = max(score for (number, members), score in found.items() if noises[number] == NARROW and members)
    assert of_effect == pytest.approx(max(found.values()) - 0.3, abs=0.2)
