"""Noise that hides the azimuth: no filter may think that it knows one, and the gyro biases hold without it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sdimu_calibration.core.effects.earth_rate import NAMES
from sdimu_calibration.core.estimation.free_azimuth import azimuth_is_lost, azimuth_sigma
from sdimu_calibration.core.estimation.outcome import outcome
from sdimu_calibration.core.estimation.solve import extend, solve
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.config import load_imu, load_model
from sdimu_sim.campaign.grade_run import simulated_test
from sdimu_sim.campaign.hidden_score import baseline_z

SITE = Site(math.radians(52.0), 0.0)
FLICKER = ("gyro_noise_flicker=25 deg/h", "accel_noise_flicker=150 ug")
"""The bias instability that mems_consumer states."""


def solved(seed, noise=(), site=SITE, plan="kim18_10_min"):
    test, sensor = simulated_test("mems_consumer", load_imu("mems_consumer"), plan, site, seed, (), noise)
    return solve(test, load_model("baseline")), sensor


@pytest.fixture(scope="module")
def hidden():
    return [solved(seed, FLICKER) for seed in (1, 2, 3)]


@pytest.mark.parametrize("plan", ["kim18_10_min", "recommended"])
def test_white_noise_leaves_as_much_of_the_azimuth_as_the_mean_rates_do(plan):
    """Tilt and noise of the force are no knowledge of azimuth: with them the filter was sure to a seventh of this."""
    fit, _ = solved(1, plan=plan)
    assert not fit.azimuth_free
    by_rates = azimuth_sigma(fit, ())
    assert 0.5 * by_rates < fit.last.output.sigma[-1, 8] < 1.5 * by_rates


def test_flicker_as_large_as_earth_rate_hides_the_azimuth_and_says_so(hidden):
    for fit, _ in hidden:
        assert fit.azimuth_free
        assert azimuth_sigma(fit, fit.noise_terms) > 0.1
        assert not azimuth_is_lost(fit, fit.noise_terms)
        assert any("hides the azimuth" in note for note in fit.notes())
        assert not set(NAMES) & set(fit.names)


def test_the_coefficients_are_right_without_an_azimuth(hidden):
    z = np.concatenate([baseline_z(outcome(fit), sensor) for fit, sensor in hidden])
    assert np.max(np.abs(z)) < 5.0
    assert np.sqrt(np.mean(z**2)) < 1.3


def test_the_passes_converge_where_no_azimuth_is_known(hidden):
    assert all(fit.converged and fit.passes <= 12 for fit, _ in hidden)


def test_an_effect_more_keeps_the_azimuth_free(hidden):
    wider = extend(hidden[0][0], ["accel_quadratic"], learn=False)
    assert wider.azimuth_free
    assert wider.names[-1].startswith("accel_quadratic")


def test_an_azimuth_that_the_site_states_is_not_lost():
    stated = Site(SITE.latitude_rad, 0.0, initial_azimuth_rad=0.0, initial_azimuth_sigma_rad=0.06)
    fit, _ = solved(1, FLICKER, stated)
    assert not fit.azimuth_free
