"""Populations of units: who is out, what is common, what follows the date."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.fleet.common import adjusted, common_effects, given
from sdimu_calibration.core.fleet.population import FALSE_ALARM, Measured, measured, population
from sdimu_calibration.core.fleet.priors import population_priors
from sdimu_calibration.core.fleet.study import AGE, PRODUCTION, YEAR_S, trends
from sdimu_calibration.core.recording import DataError

NAMES = tuple("abcdef")


def fleet(seed: int, units: int = 8, each: int = 1, spread: float = 3.0, repeat: float = 0.0) -> Measured:
    """Units with coefficients about 10, errors of 0.2 to 1."""
    rng = np.random.default_rng(seed)
    m, p = units * each, len(NAMES)
    own = 10.0 + spread * np.repeat(rng.standard_normal((units, p)), each, axis=0)
    sigmas = rng.uniform(0.2, 1.0, (m, p))
    values = own + repeat * rng.standard_normal((m, p)) + sigmas * rng.standard_normal((m, p))
    serials = tuple(f"SN{k // each}" for k in range(m))
    return Measured(NAMES, values, sigmas, serials, YEAR_S * rng.uniform(0.0, 2.0, m))


def test_a_clean_fleet_has_a_unit_out_no_more_often_than_stated():
    seeds = 80
    false = sum(bool(population(fleet(seed)).out) for seed in range(seeds))
    # 95 % of counts of a rate of FALSE_ALARM are below this.
    assert false <= FALSE_ALARM * seeds + 2.0 * np.sqrt(FALSE_ALARM * seeds)


def test_a_unit_out_is_named_with_its_coefficient_and_no_other():
    seeds = 20
    right = 0
    for seed in range(seeds):
        one = fleet(seed, units=12)
        one.values[3, 2] += 60.0  # twenty spreads
        found = population(one)
        right += [(o.unit, o.coefficient) for o in found.out] == [("SN3", "c")]
    assert right >= 0.9 * seeds


def test_repeats_of_a_unit_tell_what_varies_within_from_what_varies_between():
    within, between, inside = [], [], 0
    seeds = 30
    for seed in range(seeds):
        for one in population(fleet(seed, units=6, each=3, spread=3.0, repeat=1.0)).coefficients:
            within.append(one.within.spread**2)
            between.append(one.between.spread**2)
            inside += one.within.low <= 1.0 <= one.within.high
    count = seeds * len(NAMES)
    assert np.mean(within) == pytest.approx(1.0, rel=0.2)
    assert np.mean(between) == pytest.approx(9.0, rel=0.2)
    assert inside / count == pytest.approx(0.95, abs=3.0 * np.sqrt(0.95 * 0.05 / count))


def test_results_of_one_serial_count_as_one_unit():
    found = population(fleet(1, units=4, each=3))
    assert found.units == ("SN0", "SN1", "SN2", "SN3")
    assert all(one.between.dof == 3 for one in found.coefficients)


def test_two_units_are_no_population():
    with pytest.raises(DataError, match="2 units"):
        population(fleet(1, units=2, each=4))


def test_what_the_frame_fixes_is_no_coefficient_of_the_fleet():
    covariances = np.repeat(np.diag([1.0, 0.0])[None], 3, axis=0)
    kept = measured(("a", "fixed"), np.ones((3, 2)), covariances, ("x", "y", "z"), np.zeros(3))
    assert kept.names == ("a",)


def test_a_covariance_that_is_no_number_is_refused():
    with pytest.raises(DataError, match="not a number"):
        measured(("a",), np.ones((3, 1)), np.full((3, 1, 1), np.nan), ("x", "y", "z"), np.zeros(3))


def test_a_weak_effect_that_all_units_have_is_named_and_the_false_ones_are_few():
    # 1.5 sigma in each of twelve units: in no unit alone would it stand out of forty candidates.
    found = false = named = 0
    seeds = 40
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        estimates = 1e-6 * (rng.standard_normal((12, 40)) + np.where(np.arange(40) == 7, 1.5, 0.0))
        result = common_effects([str(k) for k in range(40)], estimates, np.full((12, 40), 1e-6))
        found += any(e.named and e.name == "7" for e in result)
        false += sum(e.named and e.name != "7" for e in result)
        named += sum(e.named for e in result)
    assert found >= 0.95 * seeds
    assert false <= 0.05 * named + 2.0 * np.sqrt(0.05 * named)


def test_an_effect_of_either_sign_is_found_by_its_variance():
    rng = np.random.default_rng(3)
    estimates = rng.standard_normal((20, 30))
    estimates[:, 4] += 2.5 * rng.standard_normal(20)
    result = common_effects([str(k) for k in range(30)], estimates, np.ones((20, 30)))
    assert [e.name for e in result if e.named] == ["4"]
    assert result[0].spread == pytest.approx(2.5, rel=0.5)


@pytest.mark.parametrize("m", [3, 6, 20])
def test_pure_noise_exceeds_its_probability_no_more_often_than_stated(m):
    estimates = np.random.default_rng(m).standard_normal((m, 2000))
    result = common_effects([str(k) for k in range(2000)], estimates, np.ones((m, 2000)))
    share = np.mean([e.p_value < 0.05 for e in result])
    assert share <= 0.05 + 2.0 * np.sqrt(0.05 * 0.95 / 2000)


def test_what_only_resembles_the_effect_of_a_type_is_not_named_with_it():
    # Candidates 1 to 5 have a half of the signature of candidate 0, candidate 6 all but a tenth of it.
    mix = np.eye(8)
    mix[1:6, 0], mix[6, 0] = 0.6, 3.0
    root = mix / np.linalg.norm(mix, axis=1, keepdims=True)
    correlation = root @ root.T
    kept = np.rint(127 * np.repeat(correlation[None], 12, axis=0)).astype(np.int8)
    seeds, right, others = 40, 0, 0
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        z = rng.standard_normal((12, 8)) @ root.T + 3.0 * correlation[0]
        alone = common_effects([str(k) for k in range(8)], z, np.ones((12, 8)))
        result = common_effects([str(k) for k in range(8)], z, np.ones((12, 8)), correlations=kept)
        named = [e for e in result if e.named]
        right += named[0].name == "0" or "0" in named[0].alike
        others += len(named) > 1
        assert sum(e.named for e in alone) > 3
    assert right >= 0.95 * seeds
    assert others <= 0.05 * seeds + 2.0 * np.sqrt(0.05 * seeds)


def test_an_effect_is_estimated_along_as_least_squares_does():
    rng = np.random.default_rng(8)
    W = rng.standard_normal((50, 3)) + rng.standard_normal((50, 1))
    e = W @ np.array([1.0, -2.0, 0.5]) + rng.standard_normal(50)
    J = W.T @ W
    sigma = 1.0 / np.sqrt(np.diag(J))
    kept = np.rint(127 * J * np.outer(sigma, sigma)).astype(np.int8)[None]
    value, error = given((W.T @ e / np.diag(J))[None], sigma[None], kept, [0])
    both = W[:, [0, 2]]
    covariance = np.linalg.inv(both.T @ both)
    assert value[0, 2] == pytest.approx((covariance @ both.T @ e)[1], abs=0.1 * error[0, 2])
    assert error[0, 2] == pytest.approx(np.sqrt(covariance[1, 1]), rel=0.02)
    assert np.isnan(value[0, 0])


def test_units_that_cannot_show_an_effect_are_not_counted():
    estimates = np.array([[1.0, 1.0], [1.0, np.nan], [1.0, np.nan]])
    assert [e.name for e in common_effects(("a", "b"), estimates, np.ones((3, 2)))] == ["a"]


def test_probabilities_are_adjusted_as_benjamini_and_hochberg_do():
    assert adjusted(np.array([0.04, 0.01, 0.03, 0.5])) == pytest.approx([0.16 / 3, 0.04, 0.16 / 3, 0.5])


def test_production_that_drifts_and_units_that_age_are_told_apart():
    one = fleet(2, units=10, each=3)
    dates = one.dates_s / YEAR_S
    means = np.repeat(dates.reshape(10, 3).mean(axis=1), 3)
    one.values[:, 0] += 40.0 * (dates - means)
    one.values[:, 1] += 40.0 * means
    found = {(t.coefficient, t.kind): t for t in trends(one)}
    assert {key for key, t in found.items() if t.named} == {("a", AGE), ("b", PRODUCTION)}
    aged = found["a", AGE]
    assert abs(aged.slope - 40.0) < 4.0 * aged.slope_sigma


def test_without_dates_there_are_no_trends():
    one = fleet(2)
    assert trends(Measured(one.names, one.values, one.sigmas, one.serials, np.full(8, np.nan))) == ()


def test_the_prior_of_an_effect_is_that_of_a_unit_nobody_has_measured():
    seen = fleet(4, units=200, spread=3.0)
    priors = population_priors(population(seen), dict.fromkeys(NAMES, "one"))
    # Mean 10, spread 3 of all coefficients; 200 units know the spread to 5 %.
    assert priors["one"] == pytest.approx(np.sqrt(10.0**2 + 3.0**2), rel=0.03)
