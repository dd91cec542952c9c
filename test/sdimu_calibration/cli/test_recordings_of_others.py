"""`sdimu import` with a map and `sdimu calibrate BAG` without an option: recordings as others make them."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from sdimu_calibration.cli import main as cli
from sdimu_calibration.core.units import STANDARD_GRAVITY
from sdimu_calibration.storage.files.config import load_imu, load_site
from sdimu_calibration.storage.files.result_file import read_result
from sdimu_sim.core.by_hand import ByHand, against_gravity, by_hand_recording
from sdimu_sim.core.generator import gravity_of
from sdimu_sim.core.truth import in_body_frame

COUNTS = """
format: sdimu-import/1
time: {column: t, unit: 10ms}
accel: {columns: [ax, ay, az], unit: g, counts_per_unit: 16384}
gyro: {columns: [gx, gy, gz], unit: deg/s, counts_per_unit: 131}
"""


@pytest.fixture
def sdimu(monkeypatch, capsys):
    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["sdimu", *map(str, arguments)])
        with pytest.raises(SystemExit) as ending:
            cli.main()
        return ending.value.code or 0, capsys.readouterr().out

    return run


def write(path, t, w, f):
    """A file of counts as a cheap board writes it, with a line above the headings."""
    rows = np.column_stack([t, np.rint(np.degrees(w) * 131), np.rint(f / STANDARD_GRAVITY * 16384)])
    np.savetxt(path, rows, fmt="%d", delimiter=",", header="Fs,50\nt,gx,gy,gz,ax,ay,az", comments="")
    return path


def calibrated(sdimu, folder, files):
    (folder / "map.yaml").write_text(COUNTS)
    status, told = sdimu("import", *files, "--map", folder / "map.yaml", "--out", folder / "bag")
    assert status == 0
    status, more = sdimu("calibrate", folder / "bag", "--out", folder / "out")
    assert status == 0
    return read_result(folder / "out"), told + more


def test_a_run_by_hand_whose_stamps_come_in_packets(sdimu, tmp_path):
    site = load_site("daejeon")
    r, truth = by_hand_recording(ByHand(24, load_imu("mems_consumer"), site, seed=5, rate_hz=50.0))
    whole = len(r.t) // 5 * 5
    packets = np.rint(np.repeat(r.t[4:whole:5], 5) * 100)
    path = write(tmp_path / "run.csv", packets, r.omega_ib_b[:whole], r.f_ib_b[:whole])
    result, told = calibrated(sdimu, tmp_path, [path])
    assert "stamps come in bursts, 100 ms apart" in told
    assert "mems_by_hand is assumed" in told
    assert result.estimator == "handheld"
    assert result.data["lost"] == 0
    assert len(result.rests) == 24
    true = in_body_frame(against_gravity(truth, STANDARD_GRAVITY, gravity_of(site)).imu.coefficients, result.body_frame)
    sigma = np.sqrt(np.diag(result.covariance))
    # The force sensitivity of this IMU's gyros is simulated as mass unbalance, and estimated as nine elements.
    z = [
        (value - true[name]) / s
        for name, value, s in zip(result.names, result.values, sigma, strict=True)
        if s > 0.0 and "g_sensitivity" not in name
    ]
    assert len(z) == 21
    assert np.sqrt(np.mean(np.square(z))) < 2.0


def test_a_static_file_for_each_of_six_positions(sdimu, tmp_path):
    rng = np.random.default_rng(4)
    bias, scale = np.array([0.05, -0.02, 0.03]) * STANDARD_GRAVITY, np.array([1.01, 0.985, 1.004])
    rate = np.radians([0.4, -0.7, 0.2])
    files = []
    for axis in range(3):
        for sense in (1.0, -1.0):
            up = rng.standard_normal(3) * 0.02
            up[axis] = sense
            f = STANDARD_GRAVITY * up / np.linalg.norm(up) * scale + bias + rng.standard_normal((1500, 3)) * 0.02
            w = rate + np.radians(0.05) * rng.standard_normal((1500, 3))
            files.append(write(tmp_path / f"{axis}{sense}.csv", np.arange(1500) * 2, w, f))
    result, told = calibrated(sdimu, tmp_path, files)
    assert told.count("its times begin again") == 5
    assert "no turn between its attitudes is in the recording" in told
    found = dict(zip(result.names, zip(result.values, np.sqrt(np.diag(result.covariance)), strict=True), strict=True))
    for k, letter in enumerate("xyz"):
        for name, true in ((f"accel_bias_{letter}", bias[k]), (f"accel_scale_{letter}", scale[k] - 1.0)):
            value, sigma = found[name]
            assert abs(value - true) < 4.0 * sigma
        # Two positions on each axis: the bias is known to the tilt that they miss it by, times 2 deg of misalignment.
        assert found[f"accel_bias_{letter}"][1] < 3e-3 * STANDARD_GRAVITY
    assert any(note.startswith("not determined") and "gyro_scale_x" in note for note in result.notes)
