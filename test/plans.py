"""A plan that is soon done, and a recording with a hidden effect: for tests whose claim hangs on no duration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rate_table_sim.core import TableSpecification
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.recording import Recording, TableLog
from sdimu_calibration.report.report_extras import ReportExtras, report_extras
from sdimu_calibration.storage.files.config import load_imu, load_plan, load_site
from sdimu_sim.core.scenario import Scenario, generate
from sdimu_study.faults import hurried

HIDDEN = "accel_quadratic_x"
SEED = 5
ANGLES = np.radians([[0.0, -30.0], [720.0, 30.0]])
"""Two turns of the outer axis in the whole test, a sixth of one of the inner (rad)."""


def quick_plan(name: str = "kim18", dwell_s: float = 40.0) -> Plan:
    """Plan the stops of another plan for `dwell_s`, with turns at 9 deg/s: 17 minutes instead of 51.

    Every second of a test is an epoch, and every epoch costs a fit, a diagnosis and a figure the same.
    """
    plan = hurried(load_plan(name))
    return replace(plan, dwell_s=(dwell_s,) * len(plan.dwell_s))


def hidden_recording(plan: Plan) -> Recording:
    """Simulate a plan at 20 Hz with 40 ug/g^2: over twenty times what these plans see at one sigma."""
    table = TableSpecification(axes=None)
    effects = (f"{HIDDEN}=40 ug/g^2",)
    scenario = Scenario(plan, load_imu("dtg"), load_site("daejeon"), table, rate_hz=20.0, seed=SEED, effects=effects)
    return generate(scenario)[0]


def with_angles(diagnosis: Diagnosis, recording: Recording) -> ReportExtras:
    """Give what a report shows beside a diagnosis, with the table's angles, as a bag has them."""
    table = TableLog(np.array([0.0, recording.t[-1]]), ("outer", "inner"), ANGLES)
    return replace(report_extras(diagnosis), table=table)
