"""One diagnosis of a whole test with a hidden effect, for everything that shows diagnoses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rate_table_sim.core import TableSpecification
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis, diagnose
from sdimu_calibration.core.recording import Recording, TableLog
from sdimu_calibration.report.report_extras import ReportExtras, report_extras
from sdimu_calibration.storage.config import load_imu, load_model, load_plan, load_site
from sdimu_sim.core.scenario import Scenario, generate

HIDDEN = "accel_quadratic_x"
SEED = 5
ANGLES = np.radians([[0.0, -30.0], [720.0, 30.0]])
"""Two turns of the outer axis in the whole test, a sixth of one of the inner (rad)."""


@pytest.fixture(scope="session")
def recording() -> Recording:
    """With 40 ug/g^2, forty times what this plan sees at one sigma."""
    scenario = Scenario(
        load_plan("kim18"), load_imu("dtg"), load_site("daejeon"), TableSpecification(axes=None), rate_hz=20.0,
        seed=SEED, effects=(f"{HIDDEN}=40 ug/g^2",),
    )  # fmt: skip
    return generate(scenario)[0]


@pytest.fixture(scope="session")
def diagnosis(recording: Recording) -> Diagnosis:
    return diagnose(recording, load_site("daejeon"), load_imu("dtg"), load_model("baseline"))


@pytest.fixture(scope="session")
def more(recording: Recording, diagnosis: Diagnosis) -> ReportExtras:
    """With the table's angles, as a bag has them."""
    table = TableLog(np.array([0.0, recording.t[-1]]), ("outer", "inner"), ANGLES)
    return replace(report_extras(diagnosis), table=table)
