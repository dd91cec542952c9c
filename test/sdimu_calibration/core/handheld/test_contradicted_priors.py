"""By hand a file of another class costs a note, not the calibration; the right file is left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.units import STANDARD_GRAVITY
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_sim.core.by_hand import ByHand, against_gravity, by_hand_recording
from sdimu_sim.core.generator import gravity_of
from sdimu_sim.core.truth import in_body_frame

TRUE = load_imu("mems_by_hand")
MODEL = load_model("hand")


def fitted(site, seed, imu):
    recording, truth = by_hand_recording(ByHand(26, TRUE, site, seed=seed))
    fit = solve(PreparedTest(recording, imu), MODEL, "handheld")
    true = in_body_frame(against_gravity(truth, STANDARD_GRAVITY, gravity_of(site)).imu.coefficients, fit.body_frame)
    k = np.flatnonzero(np.diag(fit.covariance))
    error = np.array([fit.values[i] - true.get(fit.names[i], 0.0) for i in k])
    return fit, error / np.sqrt(np.diag(fit.covariance)[k])


def told(fit):
    return [note for note in fit.test.recording.notes if "contradict priors" in note]


def test_a_file_of_another_class_costs_a_note(site):
    """Unmended, its priors hold every coefficient at zero, and the errors are learned as scatter of 10 mg and more."""
    z = []
    for seed, name in ((5, "dtg"), (6, "fog_tactical"), (7, "mems_industrial")):
        fit, own = fitted(site, seed, load_imu(name))
        assert "gyro_misalignment" in told(fit)[0]
        assert name in told(fit)[0]
        z.append(own)
    assert np.sqrt(np.mean(np.square(np.concatenate(z)))) < 1.4


@pytest.mark.parametrize("seed", range(20, 23))
def test_the_right_file_stands(site, seed):
    fit, z = fitted(site, seed, TRUE)
    assert not told(fit)
    assert fit.test.imu is TRUE
    assert np.sqrt(np.mean(z**2)) < 2.0


def test_one_prior_that_is_too_tight_is_the_one_that_is_widened(site):
    tight = replace(TRUE, prior={**TRUE.prior, "accel_bias": TRUE.prior["accel_bias"] / 100.0})
    fit, _ = fitted(site, 5, tight)
    changed = {k for k in tight.prior if fit.test.imu.prior[k] != tight.prior[k]}
    assert changed == {"accel_bias"}


def test_a_prior_of_the_grade_that_the_file_does_not_name_is_widened_too(site):
    """A response to force of 0.2 deg/s/g is nothing that a navigation-grade gyro has; its file does not speak of it."""
    run = ByHand(26, TRUE, site, seed=5, effects=("gyro_g_sensitivity_xy=0.2 deg/s/g",))
    fit = solve(PreparedTest(by_hand_recording(run)[0], load_imu("dtg")), MODEL, "handheld")
    assert "gyro_g_sensitivity" in told(fit)[0]
    k = fit.names.index("gyro_g_sensitivity_xy")
    assert abs(fit.values[k] / np.radians(0.2) - 1.0) < 0.2
