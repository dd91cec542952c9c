"""Priors that no recording of a set contradicts by itself, and all together do."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.joint.joint_prior import prior_weight, widened
from sdimu_calibration.core.joint.member import Member
from sdimu_calibration.core.joint.set_evidence import set_evidence
from sdimu_calibration.core.joint.set_fit import SetOptions, fit_set
from sdimu_calibration.core.joint.set_result import set_outcome
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.storage.files.config import load_model
from sdimu_sim.core.scenario import Scenario, imu_truth
from sdimu_sim.core.truth import ImuTruth
from sdimu_study.score import baseline_z
from sdimu_study.worlds import simulate

from .conftest import IMU, SITE, InMemory, here, switched_on

# One attitude tells the sum of bias and scale factor alone; six tell both, as well as their noise allows.
_COARSE = replace(
    IMU,
    accel_white_noise=100.0 * IMU.accel_white_noise,
    prior={**IMU.prior, "accel_bias": 20.0 * IMU.prior["accel_bias"]},
)
_TURNS = np.array([(0, 0, 0), (1, 0, 0), (2, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)]) * np.pi / 2
_STILL = Plan("still", (100.0,), (), 0.3)


@lru_cache(maxsize=2)
def cube(sigmas):
    """Six attitudes in six files, fitted together; the scale factor of x is some sigmas of its prior too large."""
    true = switched_on(9, 0)
    true["accel_scale_x"] += sigmas * _COARSE.prior["accel_scale"]
    members = []
    for k, turn in enumerate(_TURNS):
        mount = tuple(map(float, turn))
        scenario = Scenario(_STILL, _COARSE, SITE, rate_hz=10.0, seed=9000 + k, coefficients=true, mount_rad=mount)
        test = PreparedTest(simulate(scenario, imu_truth(scenario)), _COARSE, SITE)
        members.append(Member(f"a{k}", InMemory(test), power_on="1"))
    return fit_set(members, SetOptions(load_model("baseline")), here), true


def test_a_prior_that_only_all_recordings_together_contradict_holds_nothing_back():
    fit, true = cube(15.0)
    assert not any(report.widened for report in fit.reports)
    z = baseline_z(set_outcome(fit), ImuTruth(coefficients=true))
    assert np.abs(z).max() < 3.5
    assert np.sqrt(np.mean(z**2)) < 1.3


def test_it_is_told_once_and_wide_wherever_the_set_is_asked():
    fit, _ = cube(15.0)
    said = [line for line in set_outcome(fit).warnings if "accel_scale_x" in line]
    assert len(said) == 1
    assert "times the sigma of the specification" in said[0]
    stated = prior_weight(fit.reports, fit.names)
    wider = [name for name, one, other in zip(fit.names, fit.weight, stated, strict=True) if one != other]
    assert wider == ["accel_scale_x"]
    assert np.all(fit.weight <= stated)
    np.testing.assert_array_equal(set_evidence(fit, ()).weight, fit.weight)


def test_priors_that_the_set_agrees_with_stay_to_the_last_digit():
    fit, _ = cube(0.0)
    np.testing.assert_array_equal(fit.weight, prior_weight(fit.reports, fit.names))
    assert not any("specification" in line for line in set_outcome(fit).warnings)


def test_misalignments_and_the_site_keep_their_prior():
    names = (
        "accel_misalignment_xy@r1",
        "gyro_misalignment_xz",
        "reference_latitude",
        "accel_scale_x@r1",
        "accel_bias_x",
    )
    # By themselves the data say twice as much: half of the information is the prior's.
    weight, estimate = np.ones(5), np.array([9.0, 9.0, 9.0, 9.0, 2.0])
    wider = widened(weight, names, estimate, 0.5 * np.eye(5))
    assert wider == pytest.approx([1.0, 1.0, 1.0, 180.0**-2.0, 1.0])
    # What the data know by themselves no prior moves.
    assert widened(weight, names, estimate, 1e-8 * np.eye(5)) is weight
