"""The simulator's memory of forces: the same digits however it is cut, and what it is at its limits."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_sim.core.memory import Lag, Play, memory

SIGNAL = np.cumsum(np.random.default_rng(2).normal(size=500)) / 10.0


@pytest.mark.parametrize(("kind", "option"), [("lag", 3.0), ("play", 0.5)])
def test_blocks_give_the_digits_of_the_whole(kind, option):
    whole = memory(kind, option, 0.05)(SIGNAL)
    part = memory(kind, option, 0.05)
    cut = [part(SIGNAL[a:b]) for a, b in ((0, 1), (1, 1), (1, 200), (200, 500))]
    np.testing.assert_array_equal(np.concatenate(cut), whole)


def test_a_lag_stays_behind_a_ramp_by_its_time_constant():
    t = 0.05 * np.arange(4000)
    behind = t - Lag(5.0, 0.05)(t)
    # From rest at the first sample: tau (1 - exp(-t/tau)), exactly.
    np.testing.assert_allclose(behind, 5.0 * -np.expm1(-t / 5.0), atol=1e-10)


def test_a_play_without_width_is_its_signal_and_a_wide_one_never_moves():
    np.testing.assert_allclose(Play(0.0)(SIGNAL), SIGNAL, atol=1e-12)
    np.testing.assert_array_equal(Play(1e3)(SIGNAL), SIGNAL[0])
