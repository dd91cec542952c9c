"""A handheld run, without a site, gives coefficients of per cent with honest sigmas."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from sdimu_calibration.core.data.static_detection import detect_static, hides_earth_rate
from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import ImuSpecification, Model
from sdimu_calibration.core.units import STANDARD_GRAVITY, to_si
from sdimu_sim.core.by_hand import ByHand, against_gravity, by_hand_recording
from sdimu_sim.core.generator import gravity_of
from sdimu_sim.core.truth import in_body_frame

MODEL = Model(("gyro_bias", "gyro_scale", "gyro_misalignment", "accel_bias", "accel_scale", "accel_misalignment"))
MEMS = ImuSpecification(
    "mems",
    gyro_white_noise=to_si(25, "deg/h/sqrt(Hz)"),
    accel_white_noise=to_si(150, "ug/sqrt(Hz)"),
    prior={
        "gyro_bias": to_si(1, "deg/s"),
        "gyro_scale": 0.02,
        "gyro_misalignment": to_si(2, "deg"),
        "accel_bias": to_si(20, "mg"),
        "accel_scale": 0.02,
        "accel_misalignment": to_si(2, "deg"),
    },
    grade="mems",
)


def rests_of(seed):
    """20 to 40 attitudes."""
    return int(np.random.default_rng(seed).integers(20, 41))


def errors(seed, site, **options):
    """Normalised errors of the free coefficients, their covariance, and the errors themselves."""
    recording, truth = by_hand_recording(ByHand(rests_of(seed), options.pop("imu", MEMS), site, seed=seed, **options))
    found = calibrate(recording, None, MEMS, MODEL, estimator="handheld")
    true = in_body_frame(against_gravity(truth, STANDARD_GRAVITY, gravity_of(site)).imu.coefficients, found.body_frame)
    k = np.flatnonzero(np.diag(found.covariance))
    error = np.array([found.values[i] - true[found.names[i]] for i in k])
    return error, found.covariance[np.ix_(k, k)], found


def test_errors_of_percents_are_found_with_honest_sigmas(site):
    total, dof = 0.0, 0
    for seed in (1, 2):
        error, P, _ = errors(seed, site)
        s = np.sqrt(np.diag(P))
        total += float((error / s) @ np.linalg.solve(P / np.outer(s, s), error / s))
        dof += len(error)
    assert chi2.ppf(5e-4, dof) < total < chi2.ppf(1.0 - 5e-4, dof)


@pytest.mark.slow
def test_fifty_runs_have_normalised_errors_of_one(site):
    z = []
    for seed in range(101, 151):
        error, P, _ = errors(seed, site)
        z.append(error / np.sqrt(np.diag(P)))
    assert 0.8 < np.sqrt(np.mean(np.square(z))) < 1.25


def test_without_noise_the_squares_of_the_errors_come_out_too(site):
    noise = {name: 1e-4 * getattr(MEMS, name) for name in ("gyro_white_noise", "accel_white_noise")}
    quiet = replace(MEMS, **noise)
    error, _, found = errors(2, site, imu=quiet, rate_hz=400.0)
    names = [n for n, v in zip(found.names, np.diag(found.covariance), strict=True) if v]
    linear = np.array(["bias" not in n for n in names])
    # Squares of 2 % are 4e-4; the samples of a trembling turn leave a tenth of that at most.
    assert np.max(np.abs(error[linear])) < 4e-5
    assert "Earth rate is estimated, as no site is given: 15 " in found.notes[-1]
    assert "not seen" not in found.notes[-1]


def test_gravity_that_nobody_states_is_a_convention_and_said(site):
    recording, _ = by_hand_recording(ByHand(20, MEMS, site, seed=5))
    free, placed = (calibrate(recording, where, MEMS, MODEL, estimator="handheld") for where in (None, site))
    k = [free.names.index(f"accel_scale_{axis}") for axis in "xyz"]
    ratio = (1.0 + free.values[k]) / (1.0 + placed.values[k])
    # The convention makes all axes longer alike, and knows nothing of the noise.
    np.testing.assert_allclose(ratio, gravity_of(site) / STANDARD_GRAVITY, atol=2e-6)
    assert any("standard gravity, as no site is given" in note for note in free.notes)
    assert any("of the site" in note for note in placed.notes)


def test_an_extra_force_at_rest_is_learned_and_widens_the_sigmas(site):
    recording, _ = by_hand_recording(ByHand(20, MEMS, site, seed=6))
    plain = calibrate(recording, None, MEMS, MODEL, estimator="handheld")
    rng = np.random.default_rng(6)
    moved = np.concatenate([[0.0], np.cumsum(np.linalg.norm(recording.omega_ib_b, axis=1) > 0.3)])[1:]
    level = rng.standard_normal((int(moved[-1]) + 1, 3)) * 0.05
    shaken = calibrate(
        replace(recording, f_ib_b=recording.f_ib_b + level[moved.astype(int)]), None, MEMS, MODEL, estimator="handheld"
    )
    i = plain.names.index("accel_bias_x")
    # 0.05 m/s^2 against 150 ug of noise over 3 s: 60 times as much.
    assert 20.0 < np.sqrt(shaken.covariance[i, i] / plain.covariance[i, i]) < 180.0


def test_the_choice_is_made_by_what_a_rest_shows_of_the_earth(imu, three_stops, recorded_test, site):
    recording, _ = by_hand_recording(ByHand(20, MEMS, site, seed=5))
    assert hides_earth_rate(recording, MEMS)
    assert not hides_earth_rate(recorded_test(three_stops), imu)


def test_a_coefficient_that_no_turn_shows_is_named(site):
    recording, _ = by_hand_recording(ByHand(8, MEMS, site, seed=8))
    loose = replace(MEMS, prior={**MEMS.prior, "gyro_g_squared": 1e-9})
    wider = replace(MODEL, effects=(*MODEL.effects, "gyro_g_squared"))
    found = calibrate(recording, None, loose, wider, estimator="handheld")
    assert any(note.startswith("not determined") and "gyro_g_squared" in note for note in found.notes)


def test_a_coefficient_that_was_known_before_changes_no_likelihood(site):
    recording, _ = by_hand_recording(ByHand(12, MEMS, site, seed=1))
    known = replace(MEMS, prior={**MEMS.prior, "gyro_g_sensitivity": 1e-12})
    without = calibrate(recording, None, MEMS, MODEL, estimator="handheld")
    more = calibrate(recording, None, known, Model((*MODEL.effects, "gyro_g_sensitivity")), estimator="handheld")
    assert more.fit["log_likelihood"] == pytest.approx(without.fit["log_likelihood"], abs=0.05)


def test_few_rests_are_refused(site):
    recording, _ = by_hand_recording(ByHand(3, MEMS, site, seed=8))
    with pytest.raises(DataError, match="3 rests"):
        calibrate(recording, None, MEMS, MODEL, estimator="handheld")


def without_turns(recording, which, gap_s=60.0):
    """Take the motion out of some of the turns, as if each file ended before it, and put what follows `gap_s` later."""
    rests = detect_static(recording)
    keep, t = np.ones(len(recording.t), dtype=bool), recording.t.copy()
    for i, (a, b) in enumerate(zip(rests.last[:-1], rests.first[1:], strict=True)):
        if which(i):
            keep[a:b] = False
            t[b:] += gap_s
    return replace(recording, t=t[keep], omega_ib_b=recording.omega_ib_b[keep], f_ib_b=recording.f_ib_b[keep])


@pytest.mark.parametrize("every", [1, 3])
def test_turns_that_nobody_saw_say_nothing_and_spoil_nothing(site, every):
    total, dof = 0.0, 0
    for seed in (11, 12):
        recording, truth = by_hand_recording(ByHand(24, MEMS, site, seed=seed))
        found = calibrate(without_turns(recording, lambda i: i % every == 0), None, MEMS, MODEL, estimator="handheld")
        true = in_body_frame(
            against_gravity(truth, STANDARD_GRAVITY, gravity_of(site)).imu.coefficients, found.body_frame
        )
        k = np.flatnonzero(np.diag(found.covariance))
        error = np.array([found.values[i] - true[found.names[i]] for i in k])
        s = np.sqrt(np.diag(found.covariance)[k])
        P = found.covariance[np.ix_(k, k)] / np.outer(s, s)
        total += float((error / s) @ np.linalg.solve(P, error / s))
        dof += len(k)
        assert any("turns have gaps in which anything may have happened" in note for note in found.notes)
        sigma = dict(zip(found.names, np.sqrt(np.diag(found.covariance)), strict=True))
        # Rests alone give the accelerometers; the scale factors of the gyros need turns.
        assert sigma["accel_scale_x"] < 1e-3
        assert (sigma["gyro_scale_x"] > 0.9 * MEMS.prior["gyro_scale"]) == (every == 1)
    assert chi2.ppf(5e-4, dof) < total < chi2.ppf(1.0 - 5e-4, dof)


def test_rests_are_listed_and_their_residuals_in_sigmas_make_the_chi_square_of_the_fit(site):
    recording, _ = by_hand_recording(ByHand(24, MEMS, site, seed=21))
    found = calibrate(recording, None, MEMS, MODEL, estimator="handheld")
    assert len(found.rests) == int(found.data["stops"]) == 24
    assert all(a.end_s < b.start_s for a, b in zip(found.rests[:-1], found.rests[1:], strict=True))
    assert np.isnan(found.rests[0].turn).all()
    squares = [
        np.sum(np.square(getattr(r, name)) / getattr(r, f"{name}_sigma") ** 2)
        for r in found.rests
        for name in ("rate", "force", "turn")
        if np.isfinite(getattr(r, name)).all()
    ]
    assert np.sum(squares) == pytest.approx(found.fit["nis_mean"] * found.fit["nis_dof"], rel=1e-9)
