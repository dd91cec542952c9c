"""Variance between values of known errors: its interval holds the truth as often as it says."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import linregress

from sdimu_calibration.core.fleet.reml import LEVEL, random_effect
from sdimu_calibration.core.recording import DataError

SEEDS = 400
SLACK = 4.0 * np.sqrt(LEVEL * (1.0 - LEVEL) / SEEDS)
"""Four sigmas of a share of 95 % among the seeds: twenty shares are looked at."""
SIZE = 1e-8
"""Unit of the values (rad/s): results are SI."""


def draws(m: int, spread: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Values about 2 and their errors, which differ by a factor of three."""
    rng = np.random.default_rng(seed)
    sigmas = rng.uniform(0.5, 1.5, m)
    return SIZE * (2.0 + spread * rng.standard_normal(m) + sigmas * rng.standard_normal(m)), SIZE * sigmas


@pytest.mark.parametrize("m", [4, 8, 30])
@pytest.mark.parametrize("spread", [0.5, 1.0, 3.0])
def test_spread_and_mean_are_in_their_intervals_as_often_as_stated(m, spread):
    spreads = means = 0
    for seed in range(SEEDS):
        found = random_effect(*draws(m, spread, seed))
        low, high = found.mean_interval
        spreads += found.low <= SIZE * spread <= found.high
        means += low <= SIZE * 2.0 <= high
    assert abs(spreads / SEEDS - LEVEL) < SLACK
    assert abs(means / SEEDS - LEVEL) < SLACK


def test_what_does_not_vary_is_seldom_found_to():
    false = sum(random_effect(*draws(8, 0.0, seed)).p_value < 0.05 for seed in range(SEEDS))
    assert abs(false / SEEDS - 0.05) < SLACK


def test_the_spread_within_groups_does_not_know_their_means():
    hits, found = 0, []
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        groups = [name for name in "abc" for _ in range(3)]
        values = np.repeat([0.0, 100.0, -500.0], 3) + 2.0 * rng.standard_normal(9) + 0.5 * rng.standard_normal(9)
        one = random_effect(values, np.full(9, 0.5), groups)
        hits += one.low <= 2.0 <= one.high
        found.append(one.spread**2)
    assert one.dof == 6
    assert abs(hits / SEEDS - LEVEL) < SLACK
    # Restricted likelihood takes no account of the means off the variance; its scatter over seeds is sqrt(2 / 6).
    assert np.mean(found) == pytest.approx(4.0, rel=3.0 * np.sqrt(2.0 / 6.0 / SEEDS) * 1.1)


def test_with_equal_errors_it_is_the_variance_of_the_sample():
    rng = np.random.default_rng(5)
    values = 3.0 * rng.standard_normal(12)
    found = random_effect(values, np.full(12, 0.5))
    assert found.spread**2 == pytest.approx(np.var(values, ddof=1) - 0.25, rel=1e-6)
    assert found.mean == pytest.approx(values.mean())
    assert found.mean_sigma == pytest.approx(np.std(values, ddof=1) / np.sqrt(12))


def test_a_slope_is_that_of_least_squares_where_errors_are_equal():
    rng = np.random.default_rng(6)
    x = np.linspace(-1.0, 1.0, 15)
    values = 4.0 + 2.0 * x + rng.standard_normal(15)
    found = random_effect(values, np.full(15, 0.01), x=x)
    line = linregress(x, values)
    assert found.slope == pytest.approx(line.slope)
    assert found.mean == pytest.approx(line.intercept)
    assert found.slope_p == pytest.approx(line.pvalue, rel=1e-3)


@pytest.mark.parametrize(
    ("values", "sigmas", "words"),
    [([1.0], [1.0], "two values"), ([1.0, np.nan], [1.0, 1.0], "number"), ([1.0, 2.0], [1.0, 0.0], "above zero")],
)
def test_what_gives_no_spread_is_refused(values, sigmas, words):
    with pytest.raises(DataError, match=words):
        random_effect(np.array(values), np.array(sigmas))
