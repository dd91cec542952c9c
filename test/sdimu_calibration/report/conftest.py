"""One diagnosis of a whole test with a hidden effect, for everything that shows diagnoses."""

from __future__ import annotations

import pytest

from rate_table_sim.core import TableSpecification
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis, diagnose
from sdimu_calibration.storage.config import load_imu, load_model, load_plan, load_site
from sdimu_sim.core.scenario import Scenario, generate

HIDDEN = "accel_quadratic_x"
SEED = 5


@pytest.fixture(scope="session")
def diagnosis() -> Diagnosis:
    """Of 40 ug/g^2, forty times what this plan sees at one sigma."""
    imu, site = load_imu("dtg"), load_site("daejeon")
    scenario = Scenario(
        load_plan("kim18"), imu, site, TableSpecification(axes=None), rate_hz=20.0, seed=SEED,
        effects=(f"{HIDDEN}=40 ug/g^2",),
    )  # fmt: skip
    recording, _ = generate(scenario)
    return diagnose(recording, site, imu, load_model("baseline"))
