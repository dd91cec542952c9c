"""Static recordings as one set: every grade, in noise with a memory that hides the azimuth, held to the truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.estimation.outcome import outcome
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.joint.set_diagnosis import diagnose_set
from sdimu_calibration.core.joint.set_fit import SetOptions, fit_set
from sdimu_calibration.core.joint.set_result import set_outcome
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_study.static_world import CUBE, GRADES, PAIR, beyond_prior, rests, truth, wander

from .conftest import here

OPTIONS = SetOptions(load_model("baseline"))
OF_A_CUBE, DIAGNOSED = ("dtg", "mems_by_hand", "mems_consumer"), ("fog_tactical", "mems_industrial", "rlg_navigation")
"""Grades that `.ci/run` takes as six rests of a cube, and those that it diagnoses: each has gyros that see the Earth's
rate and gyros that do not. Every grade is a pair of rests there, and all are all three in the study."""
SEEDS = [pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3, 4, 5)]


def thorough(*grades):
    """All grades, of which some alone are no study."""
    return [pytest.param(grade, marks=() if grade in grades else pytest.mark.slow) for grade in GRADES]


FURTHEST, RMS = 4.5, 1.5
"""Error in sigmas that chance reaches in one of 150,000 coefficients, and the RMS of 27 of them in one set of 5,000."""


REST_S, PLAIN_S = 40.0, 4.0
"""Length of a rest, and of one in which a walk moves on by ten times the white noise in its mean (s): in a rest of 36 s
every draw of it shows. One that takes a whole rest for it is drawn so small in three rests of ten that nothing tells it
from white noise."""


def held_to_truth(result, grade, seed, turns, noise=None):
    """See that the errors of a result are those that its sigmas say."""
    true, sigma = truth(grade, seed, turns, result.body_frame, noise), np.sqrt(np.diag(result.covariance))
    without = beyond_prior(grade)
    z = {
        name: (value - true[name]) / s
        for name, value, s in zip(result.names, result.values, sigma, strict=True)
        if s > 0.0 and name in true and name not in without
    }
    assert len(z) >= 24
    assert max(map(abs, z.values())) < FURTHEST, max(z.items(), key=lambda one: abs(one[1]))
    assert np.sqrt(np.mean(np.square(list(z.values())))) < RMS


def without_azimuth(fit):
    """Names of the recordings whose fit does without one: it has two unknowns more than the set."""
    return [r.name for r in fit.reports if len(r.start.names) > len(r.reduction.names)]


def checked(members, grade, seed, turns, noise=None):
    """Fit recordings together; see that all are used, that the result is one, and that it is right."""
    fit = fit_set(members, OPTIONS, here)
    result = set_outcome(fit)
    assert not fit.left_out
    assert len(result.values) == len(result.names) == len(result.covariance)
    assert np.isfinite(result.values).all()
    sigma = np.sqrt(np.diag(result.covariance))
    free = sigma > 0.0
    unit = result.covariance[np.ix_(free, free)] / np.outer(sigma[free], sigma[free])
    assert np.linalg.eigvalsh(unit).min() > -1e-6
    held_to_truth(result, grade, seed, turns, noise)
    return fit, result


@pytest.mark.parametrize("seed", [1, *SEEDS])
@pytest.mark.parametrize("grade", GRADES)
def test_up_and_down_are_a_set_whatever_their_order_and_names(grade, seed):
    up, down = rests(grade, seed, PAIR)
    _, result = checked((up, down), grade, seed, PAIR)
    _, other = checked((replace(down, name="a"), replace(up, name="b")), grade, seed, PAIR)
    np.testing.assert_array_equal(other.values, result.values)
    np.testing.assert_array_equal(other.covariance, result.covariance)
    assert other.fit == result.fit


@pytest.mark.parametrize("seed", [1, *SEEDS])
def test_recordings_of_which_none_knows_an_azimuth_are_a_set(seed):
    """Each has two unknowns in the place of its azimuth, which the set has not."""
    grade = "mems_by_hand"
    (gyro, _), (_, accel) = wander(load_imu(grade), PLAIN_S), wander(load_imu(grade), REST_S)
    noise = (gyro, accel)
    fit, _ = checked(rests(grade, seed, PAIR, noise), grade, seed, PAIR, noise)
    assert without_azimuth(fit) == ["r0", "r1"]


@pytest.mark.parametrize("seed", [1, *SEEDS])
@pytest.mark.parametrize("grade", thorough(*OF_A_CUBE))
def test_six_rests_of_a_cube_are_a_set(grade, seed):
    checked(rests(grade, seed, CUBE), grade, seed, CUBE)


def test_passes_that_do_not_converge_widen_no_prior():
    """In this rest the passes in white noise go to and fro; with a wider prior a scale factor of -2 fits as well."""
    found = solve(rests("fog_tactical", 482006)[3].open(), load_model("baseline"))
    result = outcome(found)
    scale = [k for k, name in enumerate(result.names) if name.startswith("gyro_scale")]
    assert (np.abs(result.values[scale]) < 3.0 * load_imu("fog_tactical").prior["gyro_scale"]).all()


@pytest.mark.parametrize("grade", thorough(*DIAGNOSED))
def test_static_recordings_are_diagnosed(grade):
    found = diagnose_set(rests(grade, 1, PAIR), OPTIONS, here)
    assert np.isfinite(found.after.values).all()
    held_to_truth(found.after, grade, 1, PAIR)


@pytest.mark.parametrize(
    ("grade", "seed", "turns", "noise"),
    [("mems_industrial", 210005, CUBE, ("accel_noise_flicker=70 ug",)), ("mems_consumer", 210010, PAIR, None)],
)
def test_noise_that_moves_within_the_only_rest_of_a_recording_is_no_warm_up(grade, seed, turns, noise):
    """A walk over 20 s looks like the ramp of a warm-up: the recording must know of noise that does so."""
    found = diagnose_set(rests(grade, seed, turns, noise), OPTIONS, here)
    assert found.verdict == Verdict.CONSISTENT
    assert found.probabilities is not None
    assert found.probabilities.nothing > 0.5
