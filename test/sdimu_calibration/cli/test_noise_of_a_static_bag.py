"""`sdimu noise` of a bare static recording: the grade that its rests show, the site beside it."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from sdimu_calibration.cli.main import app
from sdimu_calibration.storage.bags.bag_writer import BagContent, write_recording


@pytest.fixture
def static(tmp_path):
    """A consumer IMU that lies 60 s at 50 Hz, in g and deg/s."""
    rng = np.random.default_rng(2)
    ns = np.arange(1, 3001, dtype=np.int64) * 20_000_000
    rate = [0.02, -0.03, 0.05] + 0.05 * rng.standard_normal((3000, 3))
    force = [0.0, 0.0, 1.003] + 0.002 * rng.standard_normal((3000, 3))
    write_recording(tmp_path / "bag", BagContent(start_ns=0, imu_ns=ns, omega_ib_b=rate, f_ib_b=force))
    return tmp_path


def test_the_grade_is_that_of_the_rests_and_the_site_is_held_against_gravity(static):
    words = ["noise", str(static / "bag"), "--site", "daejeon", "--gyro-unit", "deg/s", "--out", str(static / "out")]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    said = " ".join(result.output.split())
    # 1.003 g against 9.79853 m/s^2: 9.83607 - 9.79853 m/s^2 is 3.83 mg.
    assert "+3.83 mg from gravity of the site" in said
    assert "those of 'mems_by_hand' (proposed by the rests" in said
    assert "--site daejeon" in said
    written = yaml.safe_load((static / "out" / "imu.yaml").read_text())
    assert written["grade"] == "mems"
