"""`sdimu import` makes a bag that `calibrate` can read, and says in one line what it cannot use."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from sdimu_calibration.cli import main as cli
from sdimu_calibration.storage.bags.bag_reader import read_recording

MAP = """
format: sdimu-import/1
time: {column: t}
accel: {columns: [ax, ay, az], unit: mg}
gyro: {columns: [gx, gy, gz], unit: deg/s}
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "map.yaml").write_text(MAP)
    t = np.arange(1, 101) * 0.01
    rows = np.column_stack([t, np.tile([1.0, 2.0, 3.0, 0.0, 0.0, 1000.0], (100, 1))])
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header="t,gx,gy,gz,ax,ay,az", fmt="%.9f")
    return tmp_path


def run(monkeypatch, *arguments) -> object:
    monkeypatch.setattr(sys, "argv", ["sdimu", *map(str, arguments)])
    with pytest.raises(SystemExit) as ending:
        cli.main()
    return ending.value.code


def test_a_csv_becomes_a_bag_in_si(folder, monkeypatch, capsys):
    arguments = ("import", folder / "a.csv", "--map", folder / "map.yaml", "--out", folder / "bag")
    assert not run(monkeypatch, *arguments)
    assert "100 samples" in capsys.readouterr().out
    r = read_recording(folder / "bag")
    assert np.allclose(r.f_ib_b, [0.0, 0.0, 9.80665])
    assert np.allclose(r.omega_ib_b, np.radians([1.0, 2.0, 3.0]))
    assert run(monkeypatch, *arguments) == 1
    assert "already there" in capsys.readouterr().err
    assert not run(monkeypatch, *arguments, "--replace")


@pytest.mark.parametrize("other", ["format: sdimu-plan/1\nname: mine\n", "format: sdimu-imu/1\n"])
def test_a_map_replaces_no_file_of_another_kind(folder, monkeypatch, capsys, other):
    """--replace of a proposed map took whatever file had its name."""
    path = folder / "a_map.yaml"
    path.write_text(other)
    arguments = ("import", folder / "a.csv", "--out", folder / "bag", "--replace")
    assert run(monkeypatch, *arguments) == 1
    assert f"{path}: is a file of another kind ({other.split()[1].partition('/')[0]})" in capsys.readouterr().err
    assert path.read_text() == other
    path.write_text(MAP)
    assert not run(monkeypatch, *arguments)
    assert path.read_text() != MAP


def test_a_bad_cell_ends_with_one_line_and_no_bag(folder, monkeypatch, capsys):
    path = folder / "a.csv"
    path.write_text(path.read_text().replace("0.500000000,1.000000000", "0.500000000,one"))
    assert run(monkeypatch, "import", path, "--map", folder / "map.yaml", "--out", folder / "bag") == 1
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert f"{path}: line 51, column gx: 'one' is not a number" in err
    assert not (folder / "bag").exists()


def test_the_next_command_of_single_attitudes_is_one_of_single_attitudes(folder, monkeypatch, capsys):
    assert not run(monkeypatch, "import", folder / "a.csv", "--each", "--out", folder / "set")
    assert capsys.readouterr().out.split()[-1] == "--each"
