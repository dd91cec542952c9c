import math

import numpy as np
import pytest

from sdimu_calibration.core.effects.accelerometer_frame import as_asked
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.filter.passes import one_pass
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.planning.predict import prepare
from sdimu_calibration.storage.files.config import load_imu, load_site
from sdimu_calibration.storage.files.model_choice import named_model

ACCELERATION = math.radians(20.0)
TURNS = tuple(
    Turn(axis, math.radians(angle), math.radians(rate))
    for axis, angle, rate in (("X", 180.0, 10.0), ("Y", -90.0, 10.0), ("Z", 90.0, 2.0), ("X", -90.0, 10.0))
)
DWELLS = (20.0, 15.0, 40.0, 12.0, 30.0)


def perfect_fit(plan: Plan, add: tuple[str, ...] = ()) -> NavigationFit:
    """Fit of a perfect IMU's recording of a plan: its covariance is that of a prediction."""
    site, imu, model = load_site("daejeon"), load_imu("dtg"), named_model("baseline", add)
    nominal = prepare(plan, site, imu, model, None, None)
    setup = nominal.setup
    done = one_pass(nominal.prepared, setup, nominal.start, nominal.start.C_nb, np.zeros(len(setup.sensors.prior)))
    test = PreparedTest(nominal.recording, imu, site)
    sensors = setup.sensors
    frame = as_asked(sensors, model.body_frame)
    return NavigationFit(test, model, sensors, setup, nominal.prepared, nominal.start, done, 1, frame)


def part(stops: int) -> Plan:
    """First stops of a plan."""
    return Plan("part", DWELLS[:stops], TURNS[: stops - 1], ACCELERATION)


@pytest.fixture(scope="session")
def first_stop() -> NavigationFit:
    return perfect_fit(part(1))
