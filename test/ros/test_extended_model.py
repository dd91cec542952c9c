"""The live node estimates whatever `sdimu calibrate --add` would."""

from __future__ import annotations

import pytest

from sdimu_calibration.storage.files.result_file import read_result

from .conftest import FitSession, write_plan

pytestmark = pytest.mark.ros

FILE = """format: sdimu-effect/1
name: coupling
title: force times rate
expressions: {accel_z: k1 * ax * wz}
parameters:
  k1: {unit: ug*s/deg/g, prior: 50 ug*s/deg/g}
"""


def test_the_live_node_takes_a_name_an_equation_and_a_file_in_one_parameter(bench: FitSession) -> None:
    write_plan(bench.plan, 12.0)
    own = bench.folder / "coupling.yaml"
    own.write_text(FILE, encoding="utf-8")
    bench.start("calibration", add=["gyro_scale_asymmetry_x", "gyro_x: ey^2", str(own)])
    for name in ("recorder", "sdimu", "rate_table"):
        bench.start(name)
    bench.wait_for_end()
    assert read_result(bench.folder).names[-3:] == ("gyro_scale_asymmetry_x", "gyro_x: ey^2", "coupling_k1")
