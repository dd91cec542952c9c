"""No verb writes over a file that it was not told to replace, nor over what it reads or any recording."""

from __future__ import annotations

import json
import shlex
import sys
from pathlib import Path

import pytest

from sdimu_calibration.cli import main as cli
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags.file_room import results_folder
from sdimu_calibration.storage.files.config import config_folder, load_imu
from sdimu_calibration.storage.files.effect_file import effect_files

WRITERS = {
    "export": "export RESULT --format matrices --out PLACE",
    "export of noise": "export RESULT --format kalibr-noise --out PLACE",
    "export of an IMU file": "export RESULT --format imu --out PLACE",
    "plan": "plan --plan kim18 --tries 1 --out PLACE",
    "plan backwards": "plan --plan kim18 --backwards --out PLACE",
    "fleet": "fleet BATCH --priors PLACE",
    "set": "set init BAG --out PLACE",
    "truth": "simulate --plan kim18 --rate 10 --out new --truth PLACE",
}
"""A line for every verb that writes a file where the user says."""


@pytest.fixture
def said(monkeypatch, capsys, tmp_path, bag, batch):
    """Run a line of `sdimu` in a folder of its own; return exit status and stderr."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "300")
    folder = batch(units=3)
    words = {"BAG": str(bag), "BATCH": str(folder), "RESULT": str(folder / "unit0_0")}

    def run(line: str) -> tuple[int, str]:
        monkeypatch.setattr(sys, "argv", ["sdimu", *(words.get(word, word) for word in shlex.split(line))])
        with pytest.raises(SystemExit) as ending:
            cli.main()
        return int(ending.value.code or 0), capsys.readouterr().err

    return run


@pytest.mark.parametrize("verb", WRITERS)
@pytest.mark.parametrize("place", ["mine.txt", "small/metadata.yaml", "small/small_0.mcap"])
def test_what_is_there_stays_as_it_is(said, tmp_path, verb, place):
    (tmp_path / "mine.txt").write_text("mine")
    before = (tmp_path / place).read_bytes()
    status, err = said(WRITERS[verb].replace("PLACE", place))
    assert (status, err.count("\n")) == (1, 1)
    assert place in err
    assert "name another" in err or "outside it" in err
    assert (tmp_path / place).read_bytes() == before


@pytest.mark.parametrize("verb", [verb for verb in WRITERS if verb not in {"truth", "plan"}])
def test_replace_replaces_a_file_but_none_of_a_recording(said, tmp_path, verb):
    (tmp_path / "mine.txt").write_text("mine")
    assert said(WRITERS[verb].replace("PLACE", "mine.txt") + " --replace")[0] == 0

    assert (tmp_path / "mine.txt").read_text() != "mine"
    status, err = said(WRITERS[verb].replace("PLACE", "small/metadata.yaml") + " --replace")
    assert status == 1
    assert "stands in the recording" in err or "is read from" in err


@pytest.mark.parametrize("verb", [verb for verb in WRITERS if verb not in {"truth", "plan"}])
def test_replace_replaces_no_file_of_another_kind(said, tmp_path, verb):
    (tmp_path / "mine.json").write_text('{"format": "sdimu-result/1"}')
    status, err = said(WRITERS[verb].replace("PLACE", "mine.json") + " --replace")
    assert (status, err.count("\n")) == (1, 1)
    assert "mine.json: is a file of another kind (sdimu-result); name another file with --" in err
    assert (tmp_path / "mine.json").read_text() == '{"format": "sdimu-result/1"}'


@pytest.mark.parametrize(
    ("line", "source"),
    [
        ("export RESULT --out batch/unit0_0/result.json --replace", "batch/unit0_0/result.json"),
        ("export RESULT --imu my.yaml --format gtsam --out my.yaml --replace", "my.yaml"),
        ("plan --plan plan.yaml --backwards --out plan.yaml --replace", "plan.yaml"),
        ("plan --plan plan.yaml --backwards --imu my.yaml --out link.yaml --replace", "my.yaml"),
        ("plan --after batch/unit0_0 --out batch/unit0_0/result.json --replace", "batch/unit0_0/result.json"),
        ("fleet BATCH --priors batch/unit0_0/result.json --replace", "batch/unit0_0/result.json"),
        ("noise BAG --imu imu.yaml --out .", "imu.yaml"),
    ],
)
def test_what_is_read_is_never_written(said, tmp_path, line, source):
    for name, shipped in (("my.yaml", "imu/dtg"), ("imu.yaml", "imu/dtg"), ("plan.yaml", "plan/kim18")):
        (tmp_path / name).write_bytes((config_folder() / f"{shipped}.yaml").read_bytes())
    (tmp_path / "link.yaml").symlink_to("my.yaml")
    before = (tmp_path / source).read_bytes()
    status, err = said(line)
    assert (status, err.count("\n")) == (1, 1)
    assert "read" in err
    assert (tmp_path / source).read_bytes() == before


def test_the_imu_file_that_a_result_names_is_never_written(said, tmp_path):
    mine, result = tmp_path / "my.yaml", tmp_path / "batch" / "unit0_0" / "result.json"
    mine.write_bytes((config_folder() / "imu/dtg.yaml").read_bytes())
    content = json.loads(result.read_text())
    result.write_text(json.dumps(content | {"origin": content["origin"] | {"imu_file": str(mine)}}))
    status, err = said("export RESULT --format imu --out my.yaml --replace")
    assert (status, f"my.yaml: is read from {mine}" in err) == (1, True)
    assert said("export RESULT --format imu --out other.yaml")[0] == 0
    assert said("export RESULT --format imu --out other.yaml --replace")[0] == 0
    assert load_imu(tmp_path / "other.yaml").prior == load_imu("dtg").prior


@pytest.mark.parametrize(("line", "name"), [("noise BAG --out .", "imu.yaml"), ("diagnose BAG --out .", "plan.yaml")])
def test_results_go_into_no_folder_where_they_would_replace_a_file_of_the_user(said, tmp_path, line, name):
    (tmp_path / name).write_text("# by hand\n")
    status, err = said(line)
    assert (status, f"{name}: is there already" in err) == (1, True)
    assert (tmp_path / name).read_text() == "# by hand\n"


@pytest.mark.parametrize(
    "line",
    [
        "calibrate BAG --out small",
        "calibrate BAG --out small/results",
        "calibrate BAG --out inner/link",
        "calibrate BAG BAG --out small",
        "diagnose BAG --out small",
        "noise BAG --out small",
        "replay BAG --out small",
        "pictures BAG --out small",
        "predict --out small",
        "run --out small",
        "datasheet BATCH --out small",
        "fleet BATCH --out small",
    ],
)
def test_no_results_are_written_into_a_recording(said, tmp_path, line):
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner" / "link").symlink_to(tmp_path / "small")
    before = sorted((tmp_path / "small").iterdir())
    status, err = said(line)
    assert (status, err.count("\n")) == (1, 1)
    assert "is a recording; choose another folder for the results" in err
    assert sorted((tmp_path / "small").iterdir()) == before


def test_metadata_of_another_program_make_no_recording(tmp_path):
    (tmp_path / "metadata.yaml").write_text("title: a project\n")
    assert results_folder(tmp_path / "out") == tmp_path / "out"
    (tmp_path / "part_0.mcap").touch()
    with pytest.raises(DataError, match="is a recording"):
        results_folder(tmp_path / "out")


def test_files_among_keys_of_effects_are_found():
    assert effect_files(["gyro_bias", "mine.yaml:k", "a/b.yaml", "gyro_x: ey^2"]) == [
        Path("mine.yaml"),
        Path("a/b.yaml"),
    ]
