"""Effects of forty sigma at once: about a fit without them the signatures are right, and no companion is named."""

from __future__ import annotations

import math

import pytest

from rate_table_sim.core import TableSpecification
from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.diagnosis.ground import Ground, Request, fresh_ground
from sdimu_calibration.core.diagnosis.problem import Problem
from sdimu_calibration.core.diagnosis.search import FALSE_ALARM
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan
from sdimu_sim.core.scenario import Scenario, generate

HIDDEN = {
    "accel_quadratic_z": "-50 ug/g^2",
    "accel_delay_z": "0.97 ms",
    "gyro_scale_quadratic_y": "-22 ppm*s/deg",
    "gyro_scale_quadratic_z": "-18 ppm*s/deg",
    "gyro_magnetic_yz": "0.13 deg/h/G",
}
"""Forty to fifty sigma each, the last one twenty."""
SITE = Site(math.radians(60.0), 0.0)


@pytest.fixture(scope="module")
def fit():
    scenario = Scenario(
        load_plan("kim18_signed"),
        load_imu("dtg"),
        SITE,
        TableSpecification(axes=None),
        rate_hz=20.0,
        seed=2,
        effects=tuple(f"{name}={size}" for name, size in HIDDEN.items()),
    )
    return solve(PreparedTest(generate(scenario)[0], load_imu("dtg"), SITE), load_model("baseline"), learn=False)


def excess(ground: Ground) -> float:
    """Chi-square of the true effects about a ground, in standard deviations beyond noise."""
    problem, evidence = Problem(ground.evidence), ground.evidence
    known, weight, _ = problem.known([evidence.names.index(name) for name in HIDDEN])
    left = evidence.e - evidence.W[:, known] @ evidence.information.estimate(known, weight)[0]
    dof = len(left) - len(known)
    return (float(left @ evidence.weighed(left[:, None])[:, 0]) - dof) / math.sqrt(2.0 * dof)


def test_the_truth_explains_the_data_about_a_fit_that_lacks_it(fit):
    """While navigation errors grew along the measured force it did not, by more than five standard deviations."""
    assert excess(fresh_ground(Request(fit, (), FALSE_ALARM), fit, (), False)) < 4.0


def test_a_weaker_effect_beside_strong_ones_is_named_and_nothing_without_a_cause(fit):
    found = climb(fit)
    labels = {c.label for c in found.chosen}
    assert {"accel_quadratic_z", "accel_delay_z", "gyro_magnetic_yz"} <= labels
    assert not any(c.family == "own" for c in found.chosen)
    assert len(labels) == len(HIDDEN)
