"""Statistics of a campaign on errors whose distribution is known."""

import numpy as np
import pytest
from scipy import stats

from sdimu_calibration.core.recording import DataError
from sdimu_study import statistics

RUNS, COEFFICIENTS, CHANNELS = 400, 27, ("a", "b", "c")
NAMES = tuple(f"c{k}" for k in range(COEFFICIENTS))
SIGMA = 10.0 ** np.linspace(-8, -3, COEFFICIENTS)
"""Of as many sizes as real coefficients have."""


def gaussian_errors(seed, overconfidence=1.0, bias=0.0):
    """Errors (n, p) that are `overconfidence` times the sigmas claimed, correlated between coefficients."""
    rng = np.random.default_rng(seed)
    mixing = np.linalg.cholesky(0.5 * np.eye(COEFFICIENTS) + 0.5)
    white = rng.standard_normal((RUNS, COEFFICIENTS)) @ mixing.T
    return SIGMA * (overconfidence * white + bias), np.tile(SIGMA, (RUNS, 1))


def found_with(seed, **what):
    return statistics.coefficient_statistics(NAMES, *gaussian_errors(seed, **what))


def all_checks(seed, **what):
    found = found_with(seed, **what)
    return [statistics.bias_check(found, RUNS), *statistics.sigma_checks(found, RUNS)]


def test_an_honest_filter_fails_no_more_checks_than_the_level_says():
    # Of 3 x 100 checks at 99 % and better (Bonferroni is conservative for correlated figures) at most 3 are expected
    # to fail; 12 would happen once in 10^4 times at 1.5 % each.
    failures = sum(not check.passed for seed in range(100) for check in all_checks(seed))
    assert failures <= 12


@pytest.mark.parametrize("overconfidence", [1.25, 0.75])
def test_a_wrong_sigma_is_flagged(overconfidence):
    # A quarter too small or too large is seven standard errors (1/sqrt(800) each) of an RMS over 400 runs.
    for seed in range(20):
        low, high = all_checks(seed, overconfidence=overconfidence)[1:]
        assert not (low.passed and high.passed)


def test_a_bias_of_a_third_of_sigma_is_flagged():
    for seed in range(20):
        check = all_checks(seed, bias=1.0 / 3.0)[0]
        assert not check.passed
        assert check.value == pytest.approx(np.sqrt(RUNS) / 3.0, rel=0.6)


def test_rms_and_sigma_of_known_errors():
    errors = np.array([[3.0, -1.0], [-3.0, 1.0], [3.0, 1.0], [-3.0, -1.0]])
    found = statistics.coefficient_statistics(("a", "b"), errors, np.tile([3.0, 2.0], (4, 1)), {"a": 1.5})
    np.testing.assert_allclose(found.rms, [3.0, 1.0])
    np.testing.assert_allclose(found.rms_z, [1.0, 0.5])
    np.testing.assert_allclose(found.bias, 0.0)
    np.testing.assert_allclose(found.bound, [1.5, 2.0])  # without a bound: the sigma
    # Standard error of a mean of four: the sample deviation over two.
    np.testing.assert_allclose(found.bias_error, errors.std(axis=0, ddof=1) / 2.0)
    assert statistics.bound_check(found, 1000).value == pytest.approx(2.0)
    assert not statistics.bound_check(found, 1000).passed


@pytest.mark.parametrize(("scale", "passes"), [(1.0, True), (1.1, False), (0.9, False)])
def test_nees_tells_a_tenth_in_the_covariance(scale, passes):
    # 27 x 400 degrees of freedom: the interval is +-3.5 %.
    values = scale * stats.chi2.rvs(COEFFICIENTS, size=RUNS, random_state=4)
    assert statistics.nees_check(values, COEFFICIENTS).passed is passes


@pytest.mark.parametrize(("scale", "passes"), [(1.0, True), (1.03, False)])
def test_nis_tells_three_per_cent(scale, passes):
    dof = np.full(RUNS, 1e4)
    nis = scale * stats.chi2.rvs(dof, random_state=5)
    assert statistics.nis_check(nis, dof).passed is passes


@pytest.mark.parametrize(("correlation", "passes"), [(0.0, True), (0.05, False), (-0.05, False)])
def test_a_correlation_of_five_per_cent_in_one_channel_is_found(correlation, passes):
    rng = np.random.default_rng(6)
    pairs = 500
    white = rng.standard_normal((RUNS, pairs + 1, len(CHANNELS)))
    # A first-order process of unit variance in the last channel.
    for k in range(1, pairs + 1):
        white[:, k, 2] = correlation * white[:, k - 1, 2] + np.sqrt(1 - correlation**2) * white[:, k, 2]
    products = np.sum(white[:, 1:] * white[:, :-1], axis=1)
    check = statistics.lag_check(products, np.full((RUNS, len(CHANNELS)), pairs), CHANNELS)
    assert check.passed is passes
    if not passes:
        assert "(c)" in check.name
        assert np.sign(check.value) == np.sign(correlation)


def test_channels_that_are_never_measured_take_no_part():
    check = statistics.lag_check(np.array([[0.0, 5.0]]), np.array([[0, 100]]), ("never", "measured"))
    assert check.name.endswith("(measured)")
    assert check.value == pytest.approx(0.5)


def test_one_run_is_no_statistics():
    with pytest.raises(DataError, match="at least 2"):
        statistics.coefficient_statistics(("a",), np.ones((1, 1)), np.ones((1, 1)))


def test_few_runs_are_not_held_to_a_margin_that_chance_exceeds():
    """Six runs of an estimator that is at its bound: the largest of 33 ratios goes beyond 1.1 nearly always."""
    rng = np.random.default_rng(6)
    passed = []
    for _ in range(50):
        errors = rng.standard_normal((6, 33))
        found = statistics.coefficient_statistics([f"c{k}" for k in range(33)], errors, np.ones((6, 33)))
        check = statistics.bound_check(found, 6)
        assert check.value > statistics.BOUND_MARGIN
        passed.append(check.passed)
    assert np.mean(passed) > 0.9
    assert statistics.bound_check(found, 10**6).high == statistics.BOUND_MARGIN
