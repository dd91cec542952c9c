"""A fit is judged in the noise that was learned, unless a missing effect hides there."""

from __future__ import annotations

import pytest

from sdimu_calibration.core.fit_statistics import FitStatistics
from sdimu_calibration.core.noise_term import NoiseTerm, may_be_an_effect

WHITE, IN_NOISE = (1.5, 2.0), (1.01, 0.98)
LEARNED = FitStatistics(0.0, WHITE[0], 300.0, 3.0, *IN_NOISE, WHITE[1])


@pytest.mark.parametrize("kind", ["random_walk", "flicker"])
def test_noise_that_data_sheets_state_judges(kind):
    assert LEARNED.judged(may_be_an_effect((NoiseTerm("gyro", kind),))) == IN_NOISE


@pytest.mark.parametrize("kind", ["markov", "stop", "turn", "shift", "attitude"])
def test_noise_that_may_be_a_missing_effect_excuses_nothing(kind):
    assert LEARNED.judged(may_be_an_effect((NoiseTerm("gyro", "flicker"), NoiseTerm("accel", kind)))) == WHITE


def test_without_learned_noise_white_noise_judges():
    assert FitStatistics(0.0, WHITE[0], 300.0, 3.0, held_out_rms=WHITE[1]).judged(may_be_an_effect(())) == WHITE
