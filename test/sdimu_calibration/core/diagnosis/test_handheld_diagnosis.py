"""A handheld run shows what its model misses, stays quiet when it misses nothing, and knows how each effect shows."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sdimu_calibration.core.diagnosis.diagnose import diagnose
from sdimu_calibration.core.diagnosis.ground import Request, candidates
from sdimu_calibration.core.diagnosis.search import FALSE_ALARM
from sdimu_calibration.core.diagnosis.summary import summarise
from sdimu_calibration.core.effects import imu_model, registry
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.evidence.handheld_evidence import places
from sdimu_calibration.core.handheld.handheld_fit import equations
from sdimu_calibration.core.handheld.handheld_scene import fit_priors
from sdimu_calibration.core.handheld.run_scatter import FORCE
from sdimu_calibration.core.units import from_si, to_si
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_calibration.storage.files.diagnosis_file import content
from sdimu_sim.core.by_hand import ByHand, by_hand_recording

IMU, MODEL = load_imu("mems_by_hand"), load_model("hand")
HIDDEN = (
    "gyro_scale_asymmetry",
    "gyro_scale_quadratic",
    "gyro_scale_cubic",
    "gyro_misalignment_asymmetry",
    "gyro_g_squared",
    "gyro_g_product",
    "accel_bias_asymmetry",
    "accel_quadratic",
    "accel_scale_asymmetry",
    "accel_cubic",
    "accel_odd_quadratic",
    "accel_cross_coupling",
    "accel_cross_product",
    "accel_cross_square",
)
SEEDS = (201, 203)
SHOWN = (
    "gyro_scale_asymmetry_x",
    "gyro_scale_cubic_z",
    "accel_quadratic_y",
    "accel_cross_coupling_xz",
    "gyro_g_squared_xy",
    "accel_bias_ramp_z",
    "gyro_bias_ramp_y",
)


@cache
def _recording(seed, effects=()):
    from sdimu_calibration.storage.files.config import load_site

    return by_hand_recording(ByHand(24, IMU, load_site("daejeon"), seed=seed, effects=effects))[0]


@cache
def _diagnosis(seed, effects=()):
    return diagnose(_recording(seed, effects), None, IMU, MODEL, estimator="handheld")


def test_a_hidden_effect_is_named_measured_and_the_scatter_falls():
    found = _diagnosis(201, ("accel_quadratic_y=3000 ug/g^2",))
    told = summarise(found)
    (one,) = told.found
    assert not found.adequate
    assert "accel_quadratic_y" in {one.candidate.label, *one.alike}
    if one.candidate.label == "accel_quadratic_y":
        assert abs(one.value - to_si(3000, "ug/g^2")) < 3.5 * one.sigma
    first, last = found.rungs
    assert last.scatter[FORCE] < 0.5 * first.scatter[FORCE]
    assert last.held_out_rms < 0.5 * first.held_out_rms
    assert one.explained == pytest.approx(1.0)
    worst = [place.channel for place in found.consistency.where[:3]]
    assert "accel_y" in worst
    # What stood out is gone: the largest of some 200 residuals.
    assert abs(places(found.evidence, found.found.chosen)[0].normalised_mean) < 5.0


def test_a_turn_shows_what_acts_only_in_turns():
    (one,) = summarise(_diagnosis(202, ("gyro_scale_asymmetry_z=4000 ppm",))).found
    assert "gyro_scale_asymmetry_z" in {one.candidate.label, *one.alike}


def test_two_that_stood_for_one_in_the_scatter_give_way_to_it():
    found = _diagnosis(201, ("gyro_scale_asymmetry_y=10000 ppm",))
    (one,) = summarise(found).found
    assert one.candidate.label == "gyro_scale_asymmetry_y"
    assert all(step.taken_out for step in found.found.steps if step.label != one.candidate.label)


def test_a_swing_in_time_is_told_with_its_period():
    still = _recording(201)
    swing = 5e-3 * 9.8 * np.sin(2.0 * np.pi * still.t / 37.0)
    force = still.f_ib_b + np.outer(swing, [1.0, 0.0, 0.0])
    (one, *_) = summarise(diagnose(replace(still, f_ib_b=force), None, IMU, MODEL, estimator="handheld")).found
    channel, _, period = one.candidate.label.partition(": sin(2 pi t / ")
    assert channel == "accel_x"
    # A tenth of a cycle over the run.
    assert abs(1.0 / float(period.split()[0]) - 1.0 / 37.0) < 0.1 / still.t[-1]
    # Its size bears the scale of the axis, 2 % (one sigma).
    assert one.value == pytest.approx(5e-3 * 9.8, rel=0.06, abs=4.0 * one.sigma)


def test_a_right_model_is_left_alone():
    finds = [len(_diagnosis(seed).found.steps) for seed in SEEDS]
    # A find has probability 0.02 a run: two of two have 4e-4.
    assert sum(n > 0 for n in finds) <= 1
    told = summarise(_diagnosis(SEEDS[int(np.argmin(finds))]))
    assert told.diagnosis.verdict == "consistent"
    assert told.found == ()
    before, after = told.diagnosis.before, told.diagnosis.after
    # What stays open has little weight, and moves no coefficient by as much as its sigma.
    assert (np.abs(after.values - before.values) <= 0.5 * np.sqrt(np.diag(after.covariance))).all()


def test_signatures_are_what_the_equations_do_when_the_effect_acts():
    whole = _fit(203)
    ready, fit = whole.ready, whole.solution
    evidence = whole.evidence([_effect(whole, label) for label in SHOWN])
    for column, label in enumerate(SHOWN, start=len(evidence.weight)):
        wider = imu_model.build([*MODEL.effects, _effect(whole, label)], IMU)
        there = fit_priors(wider, IMU, None, ready.rests)
        step = 1e-3 * wider.prior[-1]
        left = []
        for size in (-step, step):
            point = replace(fit.point, coefficients=np.append(fit.point.coefficients, size))
            residual = equations(ready.run, there, point)[1][: len(evidence.e)]
            left.append(residual)
        slope = (left[1] - left[0]) / (2.0 * step) / evidence.sigma
        error = np.linalg.norm(slope + evidence.W[:, column]) / np.linalg.norm(slope)
        # Errors of percents that act on each other.
        assert error < 0.05, label


def _fit(seed):
    return solve(PreparedTest(_recording(seed), IMU), MODEL, "handheld")


def _effect(fit, label):
    (effect,) = (e for e in candidates(Request(fit, (), FALSE_ALARM), (), own=False) if label in e.labels)
    return effect.only((label,))


def test_the_evidence_of_the_model_is_the_fit():
    whole = _fit(201)
    fit, evidence = whole.solution, whole.evidence()
    step, covariance = evidence.information.estimate(evidence.model, evidence.weight)
    sigma = np.sqrt(np.diag(fit.covariance))
    np.testing.assert_allclose(np.sqrt(np.diag(covariance))[: evidence.coefficients], sigma, rtol=1e-3)
    assert np.max(np.abs(step[: evidence.coefficients] / sigma)) < 0.02


def test_neither_the_place_nor_a_lost_sample_is_a_candidate():
    effects = candidates(Request(_fit(201), (), FALSE_ALARM), (), own=True)
    names = {e.family or e.name for e in effects}
    assert not {n for n in names if n.startswith(("reference", "gyro_lost_data"))}
    assert "accel_quadratic" in names


def test_the_file_has_the_keys_of_every_diagnosis():
    told = summarise(_diagnosis(201, ("accel_quadratic_y=3000 ug/g^2",)))
    written = content(told)
    assert written["format"] == "sdimu-diagnosis/1"
    assert written["adequate"] is False
    (one,) = written["candidates"]
    assert one["held_out_rms_after"] < one["held_out_rms_before"]
    assert one["parameters"][0]["unit"] == "m/s^2/g^2"
    assert written["where"][0]["normalised_mean"] == told.diagnosis.consistency.where[0].normalised_mean
    assert written["unexplained"] == {"is": False, "fraction": 0.0, "best_variables": []}
    assert (
        written["grown"][1]["beyond_white_noise"]["force_m_s2"]
        < (written["grown"][0]["beyond_white_noise"]["force_m_s2"])
    )


@pytest.mark.slow
def test_forty_runs_name_what_is_hidden_and_forty_others_nothing(capsys):
    finds, named, sizes, drawn = 0, 0, [], 0
    for seed in range(3001, 3041):
        clean = summarise(_diagnosis(seed))
        finds += bool(clean.found)
        hidden = _draw(clean, np.random.default_rng(seed))
        if hidden is None:
            continue
        drawn += 1
        label, size, unit = hidden
        told = summarise(_diagnosis(seed, (f"{label}={from_si(size, unit):.8g} {unit}",)))
        named += any(label in {f.candidate.label, *f.alike} for f in told.found)
        sizes += [(f.value - size) / f.sigma for f in told.found if f.candidate.label == label]
    spread = float(np.sqrt(np.mean(np.square(sizes))))
    with capsys.disabled():
        sys.stdout.write(f"\n{finds} false finds of 40; named {named} of {drawn}; RMS z of the size {spread:.2f}\n")
    # Of 40 runs with a false find in fifty, more than four have a probability of 1e-3.
    assert finds <= 4
    assert named >= 0.9 * drawn
    assert np.max(np.abs(sizes)) < 4.0


def _draw(clean, rng):
    """Draw an effect that acts alike at any time: 8 to 30 of its sigmas, at most three times what physics gives it."""
    evidence = clean.diagnosis.evidence
    able = [
        (r, size)
        for r, prior in zip(clean.reached, evidence.prior, strict=True)
        if r.testable
        and r.retention > 0.1
        and r.family in HIDDEN
        and (size := rng.uniform(8.0, 30.0) * r.sigma) < 3.0 * prior
    ]
    if not able:
        return None
    r, size = able[rng.integers(len(able))]
    return r.label, float(size * rng.choice([-1.0, 1.0])), r.display_unit


def test_a_sensitivity_to_force_is_as_large_as_the_mass_unbalances_that_the_file_states():
    """Of a file with 100 deg/h/g its elements were looked for with the 50 deg/h/g of the grade."""
    prior = {name: size for name, size in IMU.prior.items() if name != "gyro_g_sensitivity"}
    stated = to_si(100.0, "deg/h/g")
    imu = replace(IMU, prior={**prior, "gyro_mass_unbalance": stated})
    model = replace(MODEL, effects=tuple(e for e in MODEL.effects if e != "gyro_g_sensitivity"))
    fit = solve(PreparedTest(_recording(203), imu), model, "handheld")
    evidence = fit.evidence([registry.get("gyro_g_sensitivity"), registry.get("gyro_mass_unbalance")])
    size = dict(zip((one.label for one in evidence.candidates), evidence.prior.tolist(), strict=True))
    assert size["gyro_g_sensitivity_xy"] == size["gyro_mass_unbalance_qx"] == stated
    assert size["gyro_g_sensitivity_xz"] == to_si(50.0, "deg/h/g")


def test_an_effect_that_nothing_bounds_and_nothing_shows_has_no_signature():
    """No prior in the grade of the IMU, and a regressor that is zero in this run."""
    evidence = _diagnosis(203).evidence
    like = registry.get("accel_quadratic")
    unseen = replace(like, prior={}, regressors=lambda motion: np.zeros((len(motion.t), len(like.terms))))
    with np.errstate(all="raise"):
        np.testing.assert_array_equal(evidence.signature([unseen]), 0.0)
        assert np.any(evidence.signature([replace(like, prior={})]))
