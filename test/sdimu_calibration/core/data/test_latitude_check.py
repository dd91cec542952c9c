"""The latitude in the data is the site's within its sigma, anywhere; a wrong place and a wrong sign are told."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.stats import chi2

from sdimu_calibration.core import earth
from sdimu_calibration.core.data.latitude_check import (
    EarthRate,
    contradictions,
    latitude_in_data,
    observe_earth_rate,
    reversed_force,
)
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.files.config import load_imu, load_plan
from sdimu_sim.core.by_hand import ByHand, by_hand_recording
from sdimu_sim.core.scenario import Scenario, generate

DTG, KIM18 = load_imu("dtg"), load_plan("kim18")
HURRIED = Plan(
    "kim18 in a hurry",
    (20.0,) * len(KIM18.dwell_s),
    tuple(replace(turn, rate_rad_s=np.radians(9.0)) for turn in KIM18.turns),
    np.radians(9.0),
)
LATITUDES = (-65.0, -33.0, 0.0, 21.0, 36.4, 52.0)
SEEDS = range(41, 43)


@cache
def recorded(latitude_deg: float, seed: int):
    scenario = Scenario(HURRIED, DTG, Site(np.radians(latitude_deg)), rate_hz=20.0, seed=seed)
    return generate(scenario)[0]


@cache
def seen(latitude_deg: float, seed: int, sign: float = 1.0):
    r = recorded(latitude_deg, seed)
    return observe_earth_rate(r.t, r.omega_ib_b, sign * r.f_ib_b, DTG)


def test_the_vertical_rate_of_the_earth_is_right_within_its_sigma():
    found = [(seen(latitude, seed), np.sin(np.radians(latitude))) for latitude in LATITUDES for seed in SEEDS]
    assert all(s.seen and s.stops == 19 for s, _ in found)
    # One draw of coefficients serves all latitudes of a seed: only the seeds are independent.
    for k in range(len(LATITUDES)):
        z = [(s.up_rate - earth.RATE * sine) / s.up_sigma for s, sine in found[k * len(SEEDS) : (k + 1) * len(SEEDS)]]
        assert np.sum(np.square(z)) < chi2.ppf(0.9999, len(z))


def test_the_right_place_is_never_contradicted():
    for latitude in LATITUDES:
        for seed in SEEDS:
            assert contradictions(seen(latitude, seed), Site(np.radians(latitude))) == ()


def test_a_sigma_of_few_rests_raises_no_more_false_alarms_than_one_of_many():
    # Two degrees of freedom, of six rests: four times such a sigma is exceeded in 5.7 % of all draws.
    rng = np.random.default_rng(8)
    sigma = 0.02 * earth.RATE
    drawn = zip(rng.standard_normal(3000), rng.chisquare(2.0, 3000), strict=True)
    alarms = [EarthRate(sigma * z, sigma * np.sqrt(c / 2.0), 9.8, 0.01, 6, 2.0).excludes(Site(0.0)) for z, c in drawn]
    assert np.mean(alarms) < 0.002
    many = EarthRate(5.0 * sigma, sigma, 9.8, 0.01, 600, 596.0)
    assert many.excludes(Site(0.0))
    assert not replace(many, up_dof=2.0).excludes(Site(0.0))


@pytest.mark.parametrize("seed", SEEDS)
def test_a_place_far_away_is_contradicted_by_rate_and_gravity(seed):
    told = contradictions(seen(52.0, seed), Site(np.radians(5.0)))
    assert any("latitude" in line and "--site" in line for line in told)
    assert any("|f|" in line for line in told)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("latitude", [-65.0, -33.0, 36.4, 52.0])
def test_the_negative_of_the_force_is_told_by_the_sense_of_the_earth(latitude, seed):
    site = Site(np.radians(latitude))
    assert reversed_force(seen(latitude, seed, -1.0), site)
    assert any("--accel-sign -1" in line for line in contradictions(seen(latitude, seed, -1.0), site))
    assert not reversed_force(seen(latitude, seed), site)


@pytest.mark.parametrize("seed", SEEDS)
def test_at_the_equator_and_for_another_place_no_sign_is_turned(seed):
    assert not reversed_force(seen(0.0, seed, -1.0), Site(0.0))
    assert not reversed_force(seen(-65.0, seed), Site(np.radians(21.0)))


@pytest.mark.parametrize("seed", range(51, 55))
def test_gyros_that_cannot_see_the_earth_say_nothing_of_the_latitude(seed):
    imu = load_imu("mems_by_hand")
    r, _ = by_hand_recording(ByHand(20, imu, Site(np.radians(45.0)), seed=seed, rate_hz=50.0))
    found = observe_earth_rate(r.t, r.omega_ib_b, r.f_ib_b, imu)
    assert found is None or not found.seen
    assert found is None or contradictions(found, Site(np.radians(-45.0))) == ()


def test_stops_on_one_cone_say_nothing():
    # Turned about the vertical only: the bias along it and the Earth's rate are one number.
    t = np.arange(1, 20001) * 0.05
    rng = np.random.default_rng(6)
    rate = np.where((t % 100.0) > 90.0, np.radians(9.0), 0.0)
    w = 1e-6 * rng.standard_normal((len(t), 3)) + np.array([0.0, 0.0, 1.0]) * (rate + 5e-5)[:, None]
    f = np.tile([0.0, 0.0, 9.8], (len(t), 1)) + 1e-4 * rng.standard_normal((len(t), 3))
    found = observe_earth_rate(t, w, f, DTG)
    assert found is not None
    assert found.stops > 6
    assert not found.seen


@pytest.mark.parametrize(
    ("sigma_deg", "told"), [(2.0, "36.4 +- 2.0"), (0.02, "36.41 +- 0.02"), (0.003, "36.407 +- 0.003")]
)
def test_the_latitude_is_told_to_the_digits_that_its_sigma_leaves(sigma_deg, told):
    latitude = np.radians(36.407)
    rate = EarthRate(
        earth.RATE * np.sin(latitude), earth.RATE * np.cos(latitude) * np.radians(sigma_deg), 9.8, 1e-3, 9, 9.0
    )
    assert f"latitude {told} deg" in latitude_in_data(rate)
