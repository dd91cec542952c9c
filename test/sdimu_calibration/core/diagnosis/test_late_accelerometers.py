"""Accelerometers three samples late at 50 Hz: so wrong that without the delay there is no fit, and yet it is named."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.estimation.outcome import outcome
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan, load_site
from sdimu_sim.core.scenario import Scenario, generate

LATE = 3
RATE_HZ = 50.0


@pytest.fixture(scope="module")
def late():
    """A fit of a test with stops of 30 s, the force of every sample that of three samples before (`test_generator`)."""
    plan, imu = load_plan("kim18"), load_imu("dtg")
    plan = replace(plan, dwell_s=(30.0,) * len(plan.dwell_s))
    hidden = (f"accel_triad_delay={1e3 * LATE / RATE_HZ:g} ms",)
    scenario = Scenario(plan, imu, load_site("daejeon"), rate_hz=RATE_HZ, seed=7, effects=hidden)
    return solve(PreparedTest(generate(scenario)[0], imu, scenario.site), load_model("baseline"))


def test_the_model_without_the_delay_is_refused(late):
    with pytest.raises(DataError, match="contradicts the model"):
        outcome(late, held_out=False)


def test_the_diagnosis_ends_and_names_the_delay(late):
    found = climb(late)
    assert [c.label for c in found.chosen][:1] == ["accel_triad_delay"]
    assert found.verdict != "data fault"
    size = dict(zip(found.after.names, found.after.values, strict=True))["accel_triad_delay"]
    # Beyond the first order in the delay nothing is modelled: a share of (rate x delay)^2, 5e-6, and of the ramps.
    assert size == pytest.approx(LATE / RATE_HZ, rel=0.01)
    assert any("contradicts the model" in line for line in found.before.warnings)
    assert found.after.fit["nis_mean"] < 1.2
