"""Simulate, calibrate, compare: the errors are as large as the claimed covariance says, and no sign is wrong.

Nothing here is tuned to a seed: the bounds are those of chi-square for the number of values.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from scipy.stats import chi2

from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.effects.body_frame import values_in_frame
from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan, load_site
from sdimu_sim.core.scenario import Scenario, generate
from sdimu_sim.core.truth import COEFFICIENTS, in_body_frame

IMU, SITE, MODEL, KIM18 = load_imu("dtg"), load_site("daejeon"), load_model("baseline"), load_plan("kim18")
PINNED = ("accel_misalignment_xy", "accel_misalignment_xz", "accel_misalignment_yx")
DOUBT = 1e-3
"""Share of right filters that a test here would call wrong."""

SHORT = Plan(
    "kim18 in a hurry",
    (20.0,) * len(KIM18.dwell_s),
    tuple(replace(turn, rate_rad_s=np.radians(9.0)) for turn in KIM18.turns),
    np.radians(9.0),
)
"""The same orientations in ten minutes."""


class Errors(NamedTuple):
    """Errors of a calibration in the reported frame, less what that frame pins to zero."""

    names: tuple[str, ...]
    error: np.ndarray
    covariance: np.ndarray

    @property
    def z(self):
        return self.error / np.sqrt(np.diag(self.covariance))

    @property
    def nees(self):
        """Normalised squared error: chi-square with as many degrees of freedom as values."""
        sigma = np.sqrt(np.diag(self.covariance))
        correlation = self.covariance / np.outer(sigma, sigma)
        return float(self.z @ np.linalg.solve(correlation, self.z))


def errors_of(found: Calibration, coefficients) -> Errors:
    truth = in_body_frame(coefficients, found.body_frame)
    free = [i for i, name in enumerate(found.names) if name not in PINNED]
    names = tuple(found.names[i] for i in free)
    error = np.array([found.values[i] - truth[name] for i, name in zip(free, names, strict=True)])
    return Errors(names, error, found.covariance[np.ix_(free, free)])


def recovered(plan: Plan, seed: int, **options) -> Errors:
    recording, truth = generate(Scenario(plan, IMU, SITE, seed=seed, **options))
    return errors_of(calibrate(recording, SITE, IMU, MODEL, held_out=False), truth.imu.coefficients)


def bounds(dof):
    return chi2.ppf([DOUBT / 2, 1 - DOUBT / 2], dof)


def check_honest(results):
    """NEES within chi-square, and the plain RMS of z within what the correlations allow (Satterthwaite)."""
    nees = [r.nees for r in results]
    low, high = bounds(sum(len(r.z) for r in results))
    assert low < sum(nees) < high, f"NEES {sum(nees):.0f} outside {low:.0f} ... {high:.0f}"
    total, variance = sum(len(r.z) for r in results), 0.0
    for r in results:
        sigma = np.sqrt(np.diag(r.covariance))
        variance += 2.0 * float(np.sum((r.covariance / np.outer(sigma, sigma)) ** 2))
    dof = 2.0 * total**2 / variance
    low, high = np.sqrt(bounds(dof) / dof)
    rms = np.sqrt(sum(float(r.z @ r.z) for r in results) / total)
    assert low < rms < high, f"RMS of error in sigmas {rms:.3f} outside {low:.3f} ... {high:.3f}"
    return rms


def test_whole_plan_recovers_the_coefficients_within_their_covariance():
    results = [recovered(KIM18, seed, rate_hz=20.0) for seed in (101, 102, 103)]
    check_honest(results)
    # Every coefficient was learned: far below the specification from which it was drawn.
    for result in results:
        prior = np.array([IMU.prior[name.rsplit("_", 1)[0]] for name in result.names])
        assert (np.sqrt(np.diag(result.covariance)) < 0.05 * prior).all()


def test_short_plan_recovers_the_coefficients_within_their_covariance():
    check_honest([recovered(SHORT, seed, rate_hz=20.0) for seed in range(201, 207)])


@pytest.mark.parametrize("mount", [(0.0, 0.0, 0.0), (1.2, -0.7, 2.5)])
def test_recovery_does_not_need_axes_along_north_east_down(mount):
    check_honest([recovered(SHORT, 300 + k, mount_rad=mount, rate_hz=20.0) for k in range(4)])


def test_without_noise_only_second_order_is_left():
    """A perfect sensor of the model's kind, in numbers that are far below every claimed sigma."""
    quiet = replace(IMU, gyro_white_noise=0.0, accel_white_noise=0.0)
    recording, truth = generate(Scenario(SHORT, quiet, SITE, seed=7))
    found = errors_of(calibrate(recording, SITE, IMU, MODEL, held_out=False), truth.imu.coefficients)
    # The prior of one sigma pulls by (sigma / prior)^2 of the value; the rest is linearisation.
    prior = np.array([IMU.prior[name.rsplit("_", 1)[0]] for name in found.names])
    pull = np.sqrt(np.diag(found.covariance)) / prior
    assert (np.abs(found.z) < 0.1 + 3.0 * pull).all(), dict(zip(found.names, found.z, strict=True))


class Known(NamedTuple):
    """A test of a sensor in which no coefficient is small, and its right calibration."""

    recording: Recording
    coefficients: dict[str, float]
    right: Errors


@pytest.fixture(scope="module")
def nothing_small():
    rng = np.random.default_rng(17)
    size = rng.uniform(0.5, 1.5, len(COEFFICIENTS)) * rng.choice([-1.0, 1.0], len(COEFFICIENTS))
    coefficients = {
        name: float(v) * IMU.prior[name.rsplit("_", 1)[0]] for name, v in zip(COEFFICIENTS, size, strict=True)
    }
    recording, _ = generate(Scenario(SHORT, IMU, SITE, seed=17, coefficients=coefficients))
    right = errors_of(calibrate(recording, SITE, IMU, MODEL, held_out=False), coefficients)
    return Known(recording, coefficients, right)


def with_wrong_sign(parameter):
    """The baseline with one parameter's regressors of the other sign."""
    effects = []
    for name in MODEL.effects:
        effect = registry.get(name)
        wrong = [p.name == parameter for p in effect.parameters]
        if any(wrong):
            sign = np.array([-1.0 if wrong[t.parameter] else 1.0 for t in effect.terms])
            right = effect.regressors
            effect = replace(effect, regressors=lambda motion, right=right, sign=sign: right(motion) * sign)
        effects.append(effect)
    return replace(MODEL, effects=tuple(effects))


def test_the_right_signs_pass_where_wrong_ones_must_fail(nothing_small):
    check_honest([nothing_small.right])


@pytest.mark.parametrize("parameter", COEFFICIENTS)
def test_a_wrong_sign_in_any_one_regressor_is_caught(parameter, nothing_small):
    """The estimate is off by many sigmas of the right calibration. (A wrong misalignment also breaks the gauge: then
    the claimed sigma is as large as the error, and only the right one tells.)"""
    assert furthest(with_wrong_sign(parameter), parameter, nothing_small) > 8.0


def test_the_right_signs_are_found_right_in_the_frame_of_their_priors_too(nothing_small):
    assert furthest(MODEL, PINNED[0], nothing_small) < 4.0


def furthest(model, parameter, known):
    """Largest error of an estimate, in sigmas of the right calibration and in its frame."""
    # What the accelerometers' frame makes zero has regressors in the frame of the priors alone.
    model = replace(model, body_frame="prior") if parameter in PINNED else model
    found = calibrate(known.recording, SITE, IMU, model, held_out=False)
    turned = values_in_frame(found.names, found.values, MODEL.body_frame)
    error = errors_of(replace(found, values=turned, body_frame=MODEL.body_frame), known.coefficients).error
    return np.abs(error / np.sqrt(np.diag(known.right.covariance))).max()


@pytest.mark.slow
def test_thirty_whole_tests_are_honest():
    rms = check_honest([recovered(KIM18, seed) for seed in range(1, 31)])
    assert 0.85 < rms < 1.15
