"""Quiet on right models, right on wrong ones, and never an effect where the noise is at fault."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from sdimu_calibration.core.advice import Kind, Verb
from sdimu_calibration.core.diagnosis.advice import advice, untestable_reasons
from sdimu_calibration.core.diagnosis.bootstrap import bootstrap
from sdimu_calibration.core.diagnosis.candidates import own_equation
from sdimu_calibration.core.diagnosis.diagnose import climb, diagnose
from sdimu_calibration.core.diagnosis.found import found_effects, reach
from sdimu_calibration.core.diagnosis.ladder import jump, refused
from sdimu_calibration.core.diagnosis.plan_seen import plan_seen
from sdimu_calibration.core.units import to_si
from sdimu_calibration.storage.files.advice_words import sentence

SEEDS = (101, 102)
_EFFECTIVE = 150
"""Independent directions among the candidates; the design study gives 144 to 159, it is not computed here."""
_HIDDEN = ("accel_scale_asymmetry_z=60 ppm",)


def _first_scores(diagnosis):
    first = diagnosis.found.first
    return first.z[np.isfinite(first.sigma)]


def test_clean_data_give_scores_of_unit_size_and_no_find(bench):
    squares, finds = [], 0
    for seed in SEEDS:
        diagnosis = bench.diagnosis(seed=seed)
        squares.append(np.mean(_first_scores(diagnosis) ** 2))
        finds += len(diagnosis.chosen) > 0
    # Four standard errors of a mean square of as many independent normals.
    assert abs(np.mean(squares) - 1.0) < 4.0 * np.sqrt(2.0 / (_EFFECTIVE * len(SEEDS)))
    # A find in one scan has probability 0.02: two of two have 4e-4.
    assert finds <= 1


def test_a_hidden_effect_is_named_measured_and_lowers_the_held_out_error(bench):
    diagnosis = bench.diagnosis(effects=_HIDDEN)
    (one,) = found_effects(diagnosis)
    assert not diagnosis.adequate
    assert "accel_scale_asymmetry_z" in {one.candidate.label, *one.alike}
    assert one.candidate.label == "accel_scale_asymmetry_z"
    assert abs(one.value - to_si(60, "ppm")) < 3.5 * one.sigma
    assert one.held_out_after < one.held_out_before
    assert one.p_value_adjusted < 1e-6
    assert one.explained > 0.8
    # One class, wherever it is told.
    assert [step.alike for step in diagnosis.found.steps] == [one.alike]


def test_a_diagnosis_is_gone_when_nobody_holds_it(bench):
    fit = bench.fit()
    gc.collect()
    gc.disable()
    try:
        found = climb(fit)
        held = [weakref.ref(found.evidence), weakref.ref(found.found.posterior.board), weakref.ref(found.found.white)]
        del found
        assert [one() for one in held] == [None] * 3
    finally:
        gc.enable()


def test_the_free_input_shares_of_what_was_found_sum_to_what_was_explained(bench):
    diagnosis = bench.diagnosis(effects=_HIDDEN)
    shares = sum(one.explained for one in found_effects(diagnosis))
    assert shares == pytest.approx(diagnosis.explained, abs=0.02)


def test_velocity_jumps_after_turns_while_an_effect_is_missing(bench):
    missing, none = jump(bench.fit(effects=_HIDDEN))[0], jump(bench.fit())[0]
    # Standardised: 19 stops of three components scatter by a tenth about one.
    assert none == pytest.approx(1.0, abs=0.4)
    assert missing > 2.0 * none


def test_the_ladder_of_refits_says_how_far_the_error_falls_and_refuses_what_does_not_lower_it(bench):
    diagnosis = climb(bench.fit(effects=_HIDDEN), refits=True)
    given, added = diagnosis.rungs
    assert added.added == "accel_scale_asymmetry_z"
    assert added.accepted
    assert added.held_out_rms == diagnosis.after.fit["held_out_rms"] < given.held_out_rms
    assert added.log_bayes_factor > 10.0
    assert not refused(replace(added, held_out_rms=0.9), given)
    assert refused(replace(added, held_out_rms=given.held_out_rms + 0.1), given)


def test_outliers_are_told_as_wrong_samples_and_end_as_no_effect(bench):
    clean = bench.recording(seed=104)
    rng = np.random.default_rng(104)
    n = len(clean.t)
    # One sample in a hundred is wrong by twenty sigma of a sample, every axis at its own times.
    sigma = bench.imu.gyro_white_noise * np.sqrt(20.0), bench.imu.accel_white_noise * np.sqrt(20.0)
    wrong = [20.0 * s * rng.standard_normal((n, 3)) * (rng.random((n, 3)) < 0.01) for s in sigma]
    dirty = replace(clean, omega_ib_b=clean.omega_ib_b + wrong[0], f_ib_b=clean.f_ib_b + wrong[1])
    diagnosis = diagnose(dirty, bench.site, bench.imu, bench.model)
    # Most are taken away and said; the smaller ones stay, as tails of the noise.
    spikes = next(f for f in diagnosis.findings if f.kind == "spike")
    assert "jump away and back" in spikes.text
    assert spikes.text in diagnosis.sentence or diagnosis.verdict == "noise model wrong"
    assert diagnosis.verdict in ("noise model wrong", "consistent")
    assert not diagnosis.chosen


def test_a_wrong_density_ends_as_a_wrong_noise_model_and_is_measured(bench):
    told = replace(bench.imu, gyro_white_noise=bench.imu.gyro_white_noise / 1.3)
    diagnosis = diagnose(bench.recording(seed=105), bench.site, told, bench.model)
    assert diagnosis.verdict == "noise model wrong"
    gyro = diagnosis.consistency.gyro
    assert abs(gyro.ratio - 1.3) < 4.0 * gyro.sigma
    assert abs(diagnosis.consistency.accel.ratio - 1.0) < 4.0 * diagnosis.consistency.accel.sigma
    # The fit in the measured noise was no request of anybody.
    assert diagnosis.after.estimator_reason == "a table turned the IMU, and its gyros see the Earth's rate"


def test_a_wrong_latitude_is_measured_and_sent_back_to_the_site_file(bench):
    wrong = replace(bench.site, latitude_rad=bench.site.latitude_rad + np.radians(0.4))
    diagnosis = diagnose(bench.recording(seed=101), wrong, bench.imu, bench.model)
    (one,) = found = found_effects(diagnosis)
    assert one.candidate.label == "reference_latitude"
    assert not diagnosis.unexplained
    assert abs(one.value - np.radians(0.4)) < 3.5 * one.sigma
    told = advice(diagnosis, found, reach(diagnosis), plan_seen(diagnosis.evidence))
    assert any("latitude" in line and "too far North" in line for line in map(sentence, told))
    assert not any(one.kind == Kind.KEEP or one.verb == Verb.ADD for one in told)


def test_turns_of_one_sign_hide_scale_asymmetry_and_the_reason_is_said(bench):
    one_sided = bench.diagnosis(plan="kim18")
    hidden = {r.label for r in reach(one_sided) if not r.testable}
    axes = {f"gyro_scale_asymmetry_{a}" for a in "xyz"}
    assert axes <= hidden
    told = untestable_reasons(reach(one_sided), plan_seen(one_sided.evidence))
    (group,) = [b for b in told if axes <= set(b.labels)]
    assert "positive" in group.reason
    both = bench.diagnosis()
    assert not axes & {r.label for r in reach(both) if not r.testable}


def test_the_plan_is_read_from_the_motion(bench):
    seen = plan_seen(bench.diagnosis().evidence)
    plan = bench.plan()
    assert len(seen.turns) == len(plan.turns)
    assert seen.oblique == 0
    for turn, meant in zip(seen.turns, plan.turns, strict=True):
        assert "xyz".index(meant.axis.lower()) == turn.axis
        # Up to 3 deg of mount about every axis turn the body axes against the table's.
        assert turn.angle == pytest.approx(meant.angle_rad, abs=np.radians(2.0))


def test_the_search_stays_quiet_on_noise(bench):
    null = bootstrap(bench.diagnosis(), draws=20, seed=3)
    # Probability 0.02 each: four of twenty have 6e-4.
    assert null.false_finds <= 3
    assert null.rms_z == pytest.approx(1.0, abs=4.0 / np.sqrt(2.0 * _EFFECTIVE * null.draws))


def test_an_effect_far_beyond_its_class_is_measured_at_its_size_without_companions(bench):
    diagnosis = bench.diagnosis(effects=("gyro_g_product_zxz=2 deg/h/g^2",))
    (one,) = found_effects(diagnosis)
    assert one.candidate.label == "gyro_g_product_zxz"
    assert abs(one.value - to_si(2, "deg/h/g^2")) < 3.5 * one.sigma
    assert any("gyro_g_product_zxz is" in f.text for f in diagnosis.findings)


def test_a_sine_of_any_phase_and_period_is_one_equation(bench):
    diagnosis = bench.diagnosis(effects=("accel_z=15*ug*sin(2*pi*t/500 + 0.7)",))
    assert diagnosis.verdict == "own equation"
    (one,) = found_effects(diagnosis)
    # Period and phase are fitted too: what they cost is not in the sigma.
    assert abs(abs(one.value) - to_si(15, "ug")) < 5.0 * one.sigma
    assert own_equation(one.candidate.label) is not None
    assert diagnosis.after.fit["held_out_rms"] < 1.1


def test_a_bias_that_settles_after_each_turn_is_named_and_its_time_constant_found(bench):
    diagnosis = bench.diagnosis(effects=("gyro_bias_settling_y=0.3 deg/h; tau=12 s",))
    (one,) = found_effects(diagnosis)
    assert one.candidate.family == "gyro_bias_settling"
    tau = float(one.candidate.effect.options["tau"].split()[0])
    assert 6.0 < tau < 24.0


def test_what_only_the_nis_shows_is_not_called_explained(bench):
    """Two periods and a half a minute: the mean of a dwell sees nothing of it, and no candidate is so fast."""
    diagnosis = bench.diagnosis(effects=("gyro_y=0.2*deg/h*sin(2*pi*t/24)",))
    assert diagnosis.verdict in ("unexplained", "noise model wrong")
    assert not diagnosis.chosen
    assert diagnosis.p_value < 1e-6


def test_noise_with_a_memory_is_told_with_its_size(bench):
    clean = bench.recording(seed=105)
    rng = np.random.default_rng(105)
    sigma, tau = to_si(12, "ug"), 30.0
    keep = np.exp(-0.05 / tau)
    drive = sigma * np.sqrt(1.0 - keep**2) * rng.standard_normal((len(clean.t), 3))
    wander = lfilter([1.0], [1.0, -keep], drive, axis=0)
    diagnosis = diagnose(replace(clean, f_ib_b=clean.f_ib_b + wander), bench.site, bench.imu, bench.model)
    assert diagnosis.verdict == "noise model wrong"
    assert not diagnosis.chosen
    (term,) = diagnosis.found.noise
    assert (term.triad, term.kind) == ("accel", "markov")
    assert term.low < sigma < term.high
    white = bench.diagnosis(seed=SEEDS[0]).consistency
    # 19 stops of six means: 285 differences that share their means.
    assert white.gyro.slow == pytest.approx(1.0, abs=0.2)
    assert white.accel.slow == pytest.approx(1.0, abs=0.2)


def test_a_drift_that_takes_many_steps_is_called_a_wander(bench):
    jumps = " + ".join(
        f"{k}*sign(t - {t})" for k, t in zip((2, -3, 3, -2, 3), (400, 700, 1000, 1400, 1700), strict=True)
    )
    diagnosis = bench.diagnosis(effects=(f"accel_x=2*ug*({jumps})",))
    # A wander, or steps of which so many follow anything.
    assert diagnosis.verdict in {"noise model wrong", "unexplained"}
    drifts = [c for c in diagnosis.chosen if c.effect.bias_drift]
    assert len(drifts) > 2 or {term.triad for term in diagnosis.found.noise} == {"accel"}
