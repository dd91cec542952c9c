"""The study of the mount: the classical calibration takes it for scale errors, in the axes of the table alone."""

from __future__ import annotations

import math

import pytest
from plans import quick_plan

from sdimu_calibration.core.specification import Site
from sdimu_calibration.core.units import from_si
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_sim.core.scenario import Scenario
from sdimu_study.mount import ESTIMATORS, mount_study, tables

SCENARIO = Scenario(quick_plan("kim18", 40.0), load_imu("dtg"), Site(math.radians(36.4), 0.0), rate_hz=20.0)
MODEL = load_model("baseline")


def test_a_mount_spoils_the_coefficients_in_the_axes_of_the_table_alone():
    content = mount_study(SCENARIO, MODEL, (0.0, 1.0), (1,), lambda *_: None)
    assert tuple(content["rms"]) == ESTIMATORS
    by_filter, in_table, turned = (
        [from_si(float(v), "ppm") for v in content["rms"][one]["gyro_scale"]] for one in ESTIMATORS
    )
    # Each axis leaves that of the table by one degree about the two others: the half squares add up to one square.
    assert in_table[1] == pytest.approx(1e6 * math.radians(1.0) ** 2, rel=0.05)
    for one in (by_filter, turned):
        assert max(one) < 5.0
    assert in_table[0] < 5.0
    shown = tables(content, {"gyro_scale": "ppm"})[ESTIMATORS[1]]
    assert shown.headings == ("RMS error", "0 deg", "1 deg", "unit")
