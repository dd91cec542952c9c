"""Single attitudes, a file each, from columns to a joint result, without a file written by hand."""

from __future__ import annotations

import json

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from sdimu_calibration.cli.main import app
from sdimu_calibration.core import earth
from sdimu_calibration.core.recording import DataError

RUN = CliRunner()
GRAVITY = float(earth.normal_gravity(np.radians(36.4), 0.0))
"""Of the site daejeon (m/s^2)."""


def told(*words):
    result = RUN.invoke(app, [str(word) for word in words])
    if isinstance(result.exception, DataError):
        return 1, str(result.exception)
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result.exit_code, result.output


@pytest.fixture
def pair(tmp_path):
    """A consumer IMU upright and on its head, 30 s each at 50 Hz: scale of 0.4 % and bias of 5 mg along x."""
    rng = np.random.default_rng(6)
    for name, up in (("up", 1.0), ("down", -1.0)):
        f = np.array([up * GRAVITY * 1.004 + 0.049, 0.0, 0.0]) + 0.02 * rng.standard_normal((1500, 3))
        w = np.radians([0.02, -0.03, 0.05]) + 1e-3 * rng.standard_normal((1500, 3))
        table = np.column_stack([np.arange(1, 1501) * 0.02, w, f])
        np.savetxt(tmp_path / f"{name}.txt", table)
    (tmp_path / "map.yaml").write_text(
        "format: sdimu-import/1\ntime: {column: 1}\naccel: {columns: [5, 6, 7], unit: m/s^2}\n"
        "gyro: {columns: [2, 3, 4], unit: rad/s}\n"
    )
    return tmp_path


def test_each_file_becomes_a_bag_of_one_power_on_in_a_set(pair):
    words = ["import", pair / "down.txt", pair / "up.txt", "--map", pair / "map.yaml", "--each", "--power-on", "Monday"]
    code, said = told(*words, "--out", pair / "bags")
    assert code == 0, said
    assert "sdimu calibrate --set" in said
    written = yaml.safe_load((pair / "bags" / "set.yaml").read_text())
    assert [(one["bag"], one["power_on"]) for one in written["recordings"]] == [("down", "Monday"), ("up", "Monday")]
    code, said = told(
        "calibrate",
        "--set",
        pair / "bags" / "set.yaml",
        "--imu",
        "mems_consumer",
        "--site",
        "daejeon",
        "--out",
        pair / "out",
    )
    assert code in {0, 3}, said
    result = json.loads((pair / "out" / "result.json").read_text())
    found = {one["name"]: (one["value"], one["sigma"]) for one in result["coefficients"]}
    # One power-on: along the axis that stood up and down both are told apart, to the tilt of the other two.
    for name, true in (("accel_scale_x", 0.004), ("accel_bias_x", 0.049)):
        value, sigma = found[name]
        assert abs(value - true) < 4.0 * sigma
        assert sigma < 0.1 * true


def test_a_set_file_of_named_bags_with_a_power_on(pair):
    for name in ("up", "down"):
        assert told("import", pair / f"{name}.txt", "--map", pair / "map.yaml", "--out", pair / name)[0] == 0
    code, said = told("set", "init", pair / "up", pair / "down", "--power-on", "one", "--serial", "7")
    assert code == 0, said
    written = yaml.safe_load((pair / "set.yaml").read_text())["recordings"]
    assert [one["bag"] for one in written] == ["up", "down"]
    assert {(one["power_on"], one["serial"]) for one in written} == {("one", "7")}
    code, said = told("set", "init", pair / "up.txt", "--out", pair / "other.yaml")
    assert code == 1
    assert "import it first" in said
