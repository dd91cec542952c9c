"""What tests of the studies share: a fit of a clean test, and a diagnosis of one with two effects."""

from __future__ import annotations

import math

import pytest

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_study.worlds import OneTest, diagnosed, simulated_test


@pytest.fixture(scope="session")
def fit() -> Fit:
    test, _ = simulated_test("dtg", load_imu("dtg"), "kim18_signed", Site(0.6, 0.0), 5, ())
    return solve(test, load_model("baseline"))


TWO = ("accel_quadratic_z=25 ug/g^2", "gyro_bias_warm_up_y(tau=300 s)=0.2 deg/h")
"""Both certain by name; the second one has variants."""


@pytest.fixture(scope="session")
def two() -> OneTest:
    site = Site(math.radians(36.4), 0.0)
    test, sensor = simulated_test("dtg", load_imu("dtg"), "recommended", site, 12, TWO)
    return OneTest(test, load_model("baseline"), sensor, (), {"coloured": []})


@pytest.fixture(scope="session")
def two_found(two: OneTest) -> Diagnosis:
    return diagnosed(two)
