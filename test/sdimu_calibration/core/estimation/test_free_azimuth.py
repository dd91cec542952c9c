"""Noise that hides the azimuth: no filter may think that it knows one, and the gyro biases hold without it."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.adaptive.so_far import so_far
from sdimu_calibration.core.effects.earth_rate import NAMES
from sdimu_calibration.core.estimation.fit_words import MISFIT
from sdimu_calibration.core.estimation.free_azimuth import azimuth_is_lost, azimuth_sigma
from sdimu_calibration.core.estimation.outcome import outcome
from sdimu_calibration.core.estimation.solve import extend, fit_about, solve
from sdimu_calibration.core.joint.member import Job, Member, run
from sdimu_calibration.core.rotation import rotation_matrix
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_study.score import baseline_z
from sdimu_study.worlds import simulated_test

SITE = Site(math.radians(52.0), 0.0)
FLICKER = ("gyro_noise_flicker=25 deg/h", "accel_noise_flicker=150 ug")
"""The bias instability that mems_consumer states."""


def solved(seed, noise=(), site=SITE, plan="kim18_10_min"):
    test, sensor = simulated_test("mems_consumer", load_imu("mems_consumer"), plan, site, seed, (), noise)
    return solve(test, load_model("baseline")), sensor


@pytest.fixture(scope="module")
def hidden():
    return [solved(seed, FLICKER) for seed in (1, 2)]


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


def test_a_misfit_is_told_of_white_noise_and_right_at_one_is_the_other(hidden):
    fit, _ = hidden[0]
    found = replace(fit.statistics(), held_out_rms=7.0, held_out_in_noise=2.0)
    (told,) = (line for line in fit.warnings(found) if "the model" in line)
    assert told.startswith("the model in white noise does not fit (NIS ")
    assert re.search(
        r"held-out error 7\.000; 1 is right\); noise that was learned takes them to [\d.]+ and 2\.000, where 1", told
    )
    bare = fit.with_noise(None)
    (white,) = (line for line in bare.warnings(replace(bare.statistics(), nis_mean=2.0)) if "the model" in line)
    assert white.startswith("the model does not fit (NIS 2.000; 1 is right)")


def test_a_result_whose_noise_explains_the_data_is_no_misfit(hidden):
    fit = next(fit for fit, _ in hidden if {term.kind for term in fit.noise_terms} == {"flicker"})
    result = outcome(fit)
    assert result.fit["nis_mean"] > MISFIT
    assert not result.misfits
    assert any("the noise is not white" in note for note in result.notes)


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


@pytest.mark.parametrize("turned_deg", [90.0, 180.0, 270.0])
def test_the_answer_is_the_same_for_every_azimuth_that_is_assumed(hidden, turned_deg):
    first, _ = hidden[0]
    turn = rotation_matrix(np.array([0.0, 0.0, math.radians(turned_deg)]))
    sensors = np.array(
        [
            0.0 if name in NAMES else value
            for name, value in zip(first.start.names, first.start.coefficients, strict=True)
        ]
    )
    start = replace(first.start, coefficients=sensors, C_nb=turn @ first.start.C_nb)
    other = solve(first.test, first.model, "filter", start, azimuth_free=True)
    sigma = np.sqrt(np.diag(first.covariance))
    free = sigma > 0.0
    assert np.max(np.abs(other.values - first.values)[free] / sigma[free]) < 0.2


def test_a_fit_that_loses_the_azimuth_gives_way_to_one_that_does_without_it():
    """Flicker of 15 deg/h in the ten-minute test of a FOG: the filter alone is off by six sigma and more."""
    imu = load_imu("fog_tactical")
    for seed in (12, 13, 14):
        test, sensor = simulated_test(
            "fog_tactical", imu, "kim18_10_min", SITE, seed, (), ("gyro_noise_flicker=15 deg/h",)
        )
        fit = solve(test, load_model("baseline"))
        assert fit.azimuth_free
        assert fit.converged
        assert np.max(np.abs(baseline_z(outcome(fit), sensor))) < 5.0


@pytest.mark.parametrize(("sigma_deg", "free"), [(3.0, False), (60.0, True)])
def test_an_azimuth_that_the_site_states_counts_where_it_is_known_well_enough(sigma_deg, free):
    stated = Site(SITE.latitude_rad, 0.0, initial_azimuth_rad=0.0, initial_azimuth_sigma_rad=math.radians(sigma_deg))
    fit, _ = solved(1, FLICKER, stated)
    assert fit.azimuth_free == free


def test_one_attitude_tells_no_azimuth(hidden):
    fit, _ = hidden[0]
    output = fit.last.output
    level = replace(fit.last, output=output._replace(C_nb=np.broadcast_to(np.eye(3), output.C_nb.shape)))
    assert azimuth_sigma(replace(fit, last=level), ()) == math.inf


def test_what_stands_for_an_azimuth_is_told_nobody(hidden):
    fit, _ = hidden[0]
    evidence = fit.evidence()
    assert set(NAMES) <= set(evidence.names[evidence.coefficients :])
    doubt = np.eye(evidence.coefficients) * 1e-20
    np.testing.assert_allclose(fit.with_doubt(doubt).covariance, fit.covariance, rtol=1e-3, atol=1e-18)


def test_a_set_takes_each_recording_without_its_azimuth(hidden):
    fit, _ = hidden[0]
    alone = run(Job(Member("one", lambda: fit.test), fit.model))
    assert not set(NAMES) & set(alone.reduction.names)
    assert not alone.stands_alone
    assert any("hides the azimuth" in note for note in alone.notes)
    about = dict(zip(alone.reduction.names, alone.reduction.point.tolist(), strict=True))
    again = fit_about(fit.test, fit.model, about, alone.start)
    assert again.azimuth_free
    assert again.start.coefficients_of(NAMES) == pytest.approx(alone.start.coefficients_of(NAMES))


def test_a_navigation_without_aid_drifts_as_promised_in_the_noise_that_was_learned(hidden):
    """White noise promises a ninth: it knows neither that the biases wander nor that their wander bent the fit."""
    learned, white = (
        [
            (d.distance[-1] / d.promised[-1]) ** 2
            for fit in fits
            for trial in fit.free_inertial([])
            for d in trial.drifts[1:]
        ]
        for fits in ([fit for fit, _ in hidden], [fit.with_noise(None) for fit, _ in hidden])
    )
    assert np.sqrt(np.mean(white)) > 4.0
    assert 0.3 < np.sqrt(np.mean(learned)) < 2.5


def test_an_adaptive_test_does_not_take_the_convention_for_knowledge(hidden):
    fit, _ = hidden[0]
    at = so_far(fit)
    assert math.sqrt(at.state.P[8, 8]) > math.radians(1.0)
