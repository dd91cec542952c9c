"""The verb study: what a study cannot do is refused before any work."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

from sdimu_calibration.core.recording import DataError
from sdimu_study.cli.study import app


@pytest.mark.parametrize("study", ["many", "noise", "missing", "sets"])
@pytest.mark.parametrize("imu", ["mems_by_hand", "nosuch"])
def test_a_study_on_a_table_refuses_every_other_imu_file(tmp_path, study, imu):
    done = CliRunner().invoke(app, [study, "--imu", imu, "-n", "1", "--out", str(tmp_path / "o")])
    assert isinstance(done.exception, DataError)
    assert f"--imu {imu}: this study needs the file of an IMU on a rate table" in str(done.exception)
    assert "dtg" in str(done.exception)
    assert not (tmp_path / "o").exists()


def test_a_study_of_all_grades_takes_runs_by_hand_and_refuses_an_unknown_file(tmp_path):
    done = CliRunner().invoke(app, ["grades", "--imu", "nosuch", "-n", "1", "--out", str(tmp_path / "o")])
    assert "--imu nosuch: this study needs a file" in str(done.exception)
    assert "mems_by_hand" in str(done.exception)
