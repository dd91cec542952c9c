"""How long a person waits for the numbers of a refit; the candidates come after them, with a bar meanwhile."""

from __future__ import annotations

import sys
import time

import pytest

from rate_table_sim.core import TableSpecification
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.report.workbench.fit import FitSession
from sdimu_calibration.report.workbench.setting import Setting
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan, load_site
from sdimu_sim.core.scenario import Scenario, generate

LIMIT_S = 3.0


@pytest.mark.bench
def test_a_refit_of_298000_samples_takes_less_than_three_seconds(capsys):
    site, imu = load_site("daejeon"), load_imu("dtg")
    effects = ("gyro_scale_asymmetry_y=40 ppm",)
    table = TableSpecification(axes=None)
    plan = load_plan("kim18_signed")
    recording = generate(Scenario(plan, imu, site, table, rate_hz=100.0, seed=7, effects=effects))[0]
    assert len(recording.t) == 298_000
    bench = FitSession(PreparedTest(recording, imu, site), load_model("baseline"))
    bench.fit(Setting())
    bench.missing(Setting())
    for added in (("gyro_scale_asymmetry_y",), ("gyro_scale_asymmetry_y", "accel_quadratic_x")):
        start = time.process_time()
        bench.fit(Setting(added))
        numbers = time.process_time() - start
        bench.missing(Setting(added))
        with capsys.disabled():
            took = time.process_time() - start
            sys.stdout.write(f"\nrefit: numbers {numbers:.2f} s, with candidates {took:.2f} s of processor")
        assert numbers < LIMIT_S
