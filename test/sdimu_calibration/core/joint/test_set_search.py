"""What a set tells that one of its recordings does not."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sdimu_calibration.core.advice import Advice, Kind, Verb
from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.diagnosis.grades import NAMED
from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.joint.set_diagnosis import diagnose_set
from sdimu_calibration.core.joint.set_result import over_all_models
from sdimu_calibration.core.joint.set_search import SetRequest, search_set
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.posterior import coefficients
from sdimu_calibration.core.posterior.coefficients import Averages, drift_mean
from sdimu_calibration.core.posterior.noise_models import NoiseModel
from sdimu_calibration.core.probability import in_percent
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import to_si
from sdimu_calibration.storage.files.advice_words import sentence
from sdimu_calibration.storage.files.config import load_model

from .conftest import here, short, unit_set

ASYMMETRY = "gyro_scale_asymmetry_y=4 ppm"


def test_a_weak_effect_is_found_in_all_recordings_together(options):
    some = unit_set(31, [short(stops=26)] * 3, (ASYMMETRY,))
    alone = climb(solve(some.members[0].open(), load_model("baseline")))
    found = diagnose_set(some.members, options, here)
    assert not alone.chosen
    assert [f.label for f in found.findings] == ["gyro_scale_asymmetry_y"]
    assert found.findings[0].value == pytest.approx(3e-6, abs=4.0 * found.findings[0].sigma)
    assert found.verdict in {"one effect", "class of effects"}
    assert found.after.model[-1] == "gyro_scale_asymmetry_y"


def test_a_clean_set_is_consistent(options):
    some = unit_set(32, [short(), short("kim18_signed"), short()])
    found = diagnose_set(some.members, options, here)
    assert found.verdict == "consistent"
    assert not found.findings
    assert found.after.fit["held_out_rms"] < 1.25
    assert found.recurrence is None


def test_a_fault_of_one_recording_is_told_of_that_one(options):
    some = unit_set(33, [short()] * 3)
    bad = unit_set(33, [short()] * 3, ("gyro_bias_step_x(t0=400 s)=0.3 deg/h",))
    found = diagnose_set((*some.members[:2], bad.members[2]), options, here)
    assert {f.recording for f in found.findings} == {"r2"}
    assert found.findings[0].label.startswith("gyro_bias_step_x(")
    assert found.verdict == "data fault"
    assert "r2" in found.sentence


def of(found, name):
    """Value and sigma of a coefficient of a search (deg/h/h)."""
    fit = found.after
    place = fit.names.index(name)
    sigma = float(np.sqrt(fit.estimate.covariance[place, place]))
    return fit.estimate.values[place] / to_si(1.0, "deg/h/h"), sigma / to_si(1.0, "deg/h/h")


@pytest.fixture(scope="module")
def both(options):
    """What is found where all recordings have a ramp, and one has more of it."""
    some = unit_set(34, [short(stops=20)] * 3, ("gyro_bias_ramp_x=0.25 deg/h/h",))
    more = unit_set(34, [short(stops=20)] * 3, ("gyro_bias_ramp_x=1.2 deg/h/h",))
    return search_set((*some.members[:2], more.members[2]), SetRequest(options, here))


def told_alone(found):
    """Moments of the told model, in the noise of the fit, by the linear model."""
    window = found.posterior
    averages = Averages(window.board.as_stated, found.after.base.dwell_means)
    return averages.of_model(window.told.members, window.board.noise_of(found.after, window.told.noise))


def test_the_told_model_has_the_sigmas_of_its_fit(both):
    """But for the biases: how large the scatter of power-ons is stands in the fit alone."""
    names = both.posterior.board.known[: len(both.posterior.board.evidence.weight)]
    at = [both.after.names.index(name) for name in names]
    fitted = np.sqrt(np.diag(both.after.estimate.covariance)[at])
    ratio = np.sqrt(np.diag(told_alone(both).covariance)) / fitted
    # The model is linear about the fit: nothing moves, but the bias in whose mean a ramp of all recordings stands.
    moved = told_alone(both).mean / fitted
    still = np.array(names) != "gyro_bias_x"
    np.testing.assert_allclose(moved[still], 0.0, atol=0.05)
    ramp = drift_mean(resolve("gyro_bias_ramp_x"), both.after.base.dwell_means, names) / fitted
    size = both.after.estimate.values[both.after.names.index("gyro_bias_ramp_x")]
    np.testing.assert_allclose(moved, size * ramp, atol=0.05)
    scatters = np.isin(names, both.after.varying_names)
    assert scatters.sum() == 6
    np.testing.assert_allclose(ratio[~scatters], 1.0, atol=0.01)
    assert (ratio[scatters] < 0.95).all()


def test_over_the_told_model_alone_coefficients_are_those_of_its_fit(both, monkeypatch):
    """The window takes what was told as candidates, drifts in the mean over the dwells, and comes back to the fit."""
    # Without what a window of one model lacks.
    monkeypatch.setattr(coefficients, "_LEAST_LACKING", 1.0)
    fit, window = both.after, both.posterior
    noise = window.board.noise_of(fit, window.told.noise)
    told = replace(window.models[0], members=window.told.members, noise=noise, probability=1.0)
    alone = SimpleNamespace(board=window.board.as_stated, models=(told,), told=window.told)
    one = over_all_models(fit, alone)
    np.testing.assert_array_equal(one.estimate.values, fit.estimate.values)
    np.testing.assert_array_equal(one.estimate.covariance, fit.estimate.covariance)


def test_what_the_window_adds_is_the_difference_of_its_moments_to_those_of_the_told_model(both):
    window, fit = both.posterior, both.after
    mean = over_all_models(fit, window)
    all_, one = Averages(window.board, fit.base.dwell_means).of(window), told_alone(both)
    at = [fit.names.index(name) for name in window.board.known[: len(one.mean)]]
    sigma = np.sqrt(np.diag(one.covariance))
    moved = (mean.estimate.values - fit.estimate.values)[at] / sigma
    np.testing.assert_allclose(moved, (all_.mean - one.mean) / sigma, atol=1e-6)
    added = (np.diag(mean.estimate.covariance) - np.diag(fit.estimate.covariance))[at] / sigma**2
    wider = (np.diag(all_.covariance) - np.diag(one.covariance)) / sigma**2
    # What a direction is known better in is not taken off; so it may be more, and is not much more.
    assert (added > wider - 1e-9).all()
    assert np.abs(added - wider).max() < 0.1
    assert added.max() > 0.05


def test_a_drift_of_one_recording_is_none_of_the_bias_of_the_unit(both):
    window = both.posterior
    board, p = window.board, len(window.board.evidence.weight)
    averages = Averages(board, both.after.base.dwell_means)
    told = dict(window.told.members)
    every = {k: window.candidate(k) for k in range(len(board.use)) if k not in told}
    drifts = [k for k, one in every.items() if one.effect.bias_drift and one.recording]
    for number in drifts[:3]:
        members = ((number, 0),)
        data, (columns, weight) = board.in_noise(NoiseModel()), board.parameters(members)
        del columns
        at = [*range(p), p + number]
        right = np.linalg.solve(data.J[np.ix_(at, at)] + np.diag(weight), data.d[at])[:p]
        one = averages.of_model(members, NoiseModel())
        np.testing.assert_allclose((one.mean - right) / np.sqrt(np.diag(one.covariance)), 0.0, atol=1e-6)
    assert drifts


def test_what_all_have_and_one_has_more_of_is_told_as_both(both):
    """Found in one recording first, which alone takes it for a random walk."""
    found = both
    assert [c.label for c in found.chosen] == ["gyro_bias_ramp_x"]
    assert [c.label for c in found.told if c.recording] == ["gyro_bias_ramp_x@r2"]
    for name, true in (("gyro_bias_ramp_x", 0.25), ("gyro_bias_ramp_x@r2", 1.2)):
        value, sigma = of(found, name)
        assert abs(value - true) < 4.0 * sigma
    assert not any(r.noise for r in found.after.reports)


def test_one_recording_is_no_set_to_diagnose(options):
    with pytest.raises(DataError, match="a set of one recording: diagnose it by itself"):
        diagnose_set(unit_set(32, [short()]).members, options, here)


def test_what_two_recordings_leave_open_the_advised_third_one_closes(options):
    """One rate leaves asymmetry and quadratic term open; advised is another rate about the same axis."""
    strong = ("gyro_scale_asymmetry_y=40 ppm",)
    plan = short("kim18_signed", stops=20)
    two = unit_set(34, [plan, plan], strong)
    found = diagnose_set(two.members, options, here)
    assert found.verdict == "class of effects"
    assert set(found.standing.open[0]) >= {"gyro_scale_asymmetry_y", "gyro_scale_quadratic_y"}
    shares = {share.name: share.probability for share in found.findings[0].may_be}
    assert set(shares) >= {"gyro_scale_asymmetry_y", "gyro_scale_quadratic_y"}
    open_which = [name for name, p in shares.items() if p >= NAMED]
    assert all(f"{in_percent(shares[name])}" in found.sentence for name in open_which)
    assert ("open which" in found.sentence) == (len(open_which) > 1)
    line = next(a for a in map(sentence, found.advice) if "gyro_scale_quadratic_y" in a)
    assert "turn Y +90 deg at 10 deg/s" in line
    advised = Plan("advised", (100.0,) * 2, (Turn("Y", 0.5 * math.pi, math.radians(10.0)),), math.radians(20.0))
    three = unit_set(34, [plan, plan, advised], strong)
    closed = diagnose_set(three.members, options, here)
    assert [f.label for f in closed.findings] == ["gyro_scale_asymmetry_y"]
    assert "gyro_scale_quadratic_y" not in closed.findings[0].alike
    tried = Advice(Kind.TRY, ("gyro_scale_asymmetry_y",), Verb.ADD, ("gyro_scale_asymmetry_y",))
    assert [one.kind for one in found.advice[:3]] == [Kind.RECORD_ONCE_MORE, Kind.PLAN_NEXT, Kind.TRY]
    assert found.advice[2] == tried
    assert closed.advice[0] == replace(tried, kind=Kind.KEEP)
