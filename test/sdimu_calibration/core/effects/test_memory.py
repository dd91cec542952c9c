"""What effects remember: the closed forms of lag and play, and blocks that give what the whole gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.compensation.reads import any_motion
from sdimu_calibration.core.effects.memory import low_pass, play
from sdimu_calibration.core.effects.motion import NO_PAST
from sdimu_calibration.core.units import STANDARD_GRAVITY


def motion_of(a, dt=0.1):
    """Motion with this force along x (g), and nothing before."""
    f = STANDARD_GRAVITY * np.column_stack([a, 0.0 * a, -a])
    t = dt * np.arange(1.0, len(a) + 1.0)
    base = any_motion(np.random.default_rng(1))
    rows = {name: np.zeros((len(a), 3)) for name in ("w", "w_table", "alpha", "turned", "leant", "wound")}
    return replace(base, t=t, dt=np.full(len(a), dt), f=f, past=NO_PAST, **rows)


def test_the_lag_of_a_step_is_an_exponential():
    tau, dt = 7.0, 0.1
    a = np.r_[np.full(5, 0.3), np.ones(400)]
    start = dt * np.arange(400)
    mean = 1.0 - 0.7 * tau / dt * (np.exp(-start / tau) - np.exp(-(start + dt) / tau))
    y = low_pass(motion_of(a, dt), tau)
    np.testing.assert_allclose(y[5:, 0], mean, rtol=1e-12)
    np.testing.assert_allclose(y[:5, 0], 0.3, rtol=1e-12)
    np.testing.assert_allclose(y[:, 2], -y[:, 0], rtol=1e-12)


def test_play_follows_behind_a_sweep_by_its_half_width_and_stands_still_within_it():
    there = np.linspace(0.0, 1.0, 101)
    a = np.r_[there, there[::-1]]
    y = play(motion_of(a), 0.2)[:, 0]
    np.testing.assert_allclose(y[:101], np.maximum(there - 0.2, 0.0), atol=1e-12)
    np.testing.assert_allclose(y[101:], np.minimum(there[::-1] + 0.2, 0.8), atol=1e-12)
    # Within the play nothing moves: it forgets no place.
    np.testing.assert_allclose(play(motion_of(0.5 + 0.1 * np.sin(a)), 0.2)[:, 0], 0.5, atol=1e-12)


@pytest.mark.parametrize("of", [lambda m: low_pass(m, 3.0), lambda m: play(m, 0.4)])
def test_a_block_that_knows_its_past_gives_what_the_whole_gives(of):
    whole = any_motion(np.random.default_rng(4))
    n = 700
    first, second = (
        {name: getattr(whole, name)[rows] for name in ("t", "dt", "w", "f", "C_nb", "w_table")}
        for rows in (slice(None, n), slice(n, None))
    )
    before = replace(whole, **first)
    np.testing.assert_array_equal(of(before), of(whole)[:n])
    np.testing.assert_array_equal(of(replace(whole, **second, past=before.left)), of(whole)[n:])


def test_what_is_left_to_the_next_block_does_not_grow():
    m = replace(motion_of(np.ones(5000)), past=NO_PAST)
    low_pass(m, 3.0)
    play(m, 0.4)
    assert {y.shape for y in m.left.values()} == {(3,)}
    assert len(m.left) == 2
