"""Near a pole no heading comes from the Earth's rate, and the result says so instead of a wrong one."""

from __future__ import annotations

import numpy as np
import pytest

from rate_table_sim.core.specification import TableSpecification
from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_sim.core.scenario import Scenario, generate

TURNS = tuple(Turn(axis, np.radians(90.0), np.radians(15.0)) for axis in "XYZXYZXYZ")
PLAN = Plan("nine turns", (20.0,) * 10, TURNS, np.radians(60.0))


def notes_at(latitude_deg, azimuth=None):
    site = Site(latitude_rad=float(np.radians(latitude_deg)), initial_azimuth_rad=azimuth)
    imu = load_imu("dtg")
    scenario = Scenario(PLAN, imu, site, table=TableSpecification(axes=None), rate_hz=20.0, seed=3)
    return " ".join(calibrate(generate(scenario)[0], site, imu, load_model("baseline"), held_out=False).notes)


@pytest.mark.parametrize("latitude_deg", [90.0, -90.0, 89.95])
def test_at_a_pole_the_azimuth_is_called_not_observable(latitude_deg):
    assert "azimuth is not observable" in notes_at(latitude_deg)


def test_elsewhere_and_where_the_azimuth_is_given_nothing_is_said():
    assert "not observable" not in notes_at(45.0)
    assert "not observable" not in notes_at(90.0, azimuth=0.0)
