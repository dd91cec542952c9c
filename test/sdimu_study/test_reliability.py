"""What the study of probabilities counts as there: what can be seen; and what it counts at all."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import Site
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_study.reliability import score
from sdimu_study.worlds import OneTest, Truth, diagnosed, simulated_test

STRONG, WEAK = "accel_quadratic_z=25 ug/g^2", "gyro_scale_asymmetry_y=40 ppm"


def truth(text: str, sigmas: float) -> Truth:
    name, _, size = text.partition("=")
    return Truth(name, name.rpartition("_")[0], None, float(size.split()[0]), sigmas, text)


@pytest.fixture(scope="module")
def world():
    site = Site(math.radians(36.4), 0.0)
    test, sensor = simulated_test("dtg", load_imu("dtg"), "recommended", site, 12, (STRONG, WEAK))
    return OneTest(test, load_model("baseline"), sensor, (), {"coloured": []})


@pytest.fixture(scope="module")
def found(world):
    return diagnosed(world)


def right(row, what):
    return sum(true for p, true in row[what] if p > 0.9)


def test_an_effect_counts_as_there_from_two_sigma_on(world, found):
    rows = [
        score(replace(world, truths=(truth(STRONG, 25.0), truth(WEAK, sigmas))), (found, 1.0)) for sigmas in (1.99, 2.0)
    ]
    assert [right(row, "families") for row in rows] == [1, 2]
    assert [right(row, "effects") for row in rows] == [1, 2]
    assert [len(row["hidden"]) for row in rows] == [2, 2]
    alone = [score(replace(world, truths=(truth(WEAK, sigmas),)), (found, 1.0)) for sigmas in (1.99, 2.0)]
    assert [row["nothing"][0][1] for row in alone] == [True, False]


def test_data_at_fault_make_no_statement(world, found):
    with pytest.raises(DataError, match="no statement on physics"):
        score(world, (replace(found, verdict=Verdict.DATA_FAULT), 1.0))
