"""`sdimu fleet`: a folder of results to a table, fleet.json, fleet.html and priors."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.cli.fleet import fleet
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import SetRecording, SetSummary
from sdimu_calibration.core.units import to_si
from sdimu_calibration.storage.files.config import load_imu
from sdimu_calibration.storage.files.diagnosis_file import packed, unpacked
from sdimu_calibration.storage.files.fleet_folder import candidates, gather
from sdimu_calibration.storage.files.json_file import write_json
from sdimu_calibration.storage.files.result_file import read_result, write_result


def test_the_unit_that_is_out_is_named_and_the_files_say_the_same(batch, capsys, tmp_path):
    folder = batch(units=10, out=4)
    fleet([folder], out=tmp_path / "pages")
    told = capsys.readouterr().out
    assert "SN4 is out by gyro_scale_y" in told
    assert max(len(line) for line in told.splitlines() if line.startswith(" ")) <= 100  # the table
    content = json.loads((tmp_path / "pages" / "fleet.json").read_text())
    assert content["format"] == "sdimu-fleet/1"
    assert {(one["unit"], one["coefficient"]) for one in content["out"]} == {("SN4", "gyro_scale_y")}
    scale = next(one for one in content["coefficients"] if one["name"] == "gyro_scale_y")
    # The unit that is out makes the spread, and must not make the control limits.
    assert not scale["control_low"] < scale["values"][4] < scale["control_high"]
    page = (tmp_path / "pages" / "fleet.html").read_text()
    assert "SN4 is out" in page
    assert page.count('class="figure"') >= 5
    # Numbers have the sign of print on the page, that of programs in the file.
    assert re.search(r"<td>\N{MINUS SIGN}[\d.]+</td>", page)
    assert not re.search(r">-\.?\d", page)


def test_a_clean_fleet_has_nobody_out(batch, capsys):
    fleet([batch(units=10)])
    assert "No unit is out." in capsys.readouterr().out


def test_priors_are_an_imu_file_of_the_population(batch, tmp_path):
    folder = batch(units=12)
    fleet([folder], priors=tmp_path / "own.yaml")
    found, base = load_imu(tmp_path / "own.yaml"), load_imu("dtg")
    assert found.gyro_white_noise == base.gyro_white_noise
    # Drawn with one sigma of the file's: 36 values know it to 12 %; four of them.
    assert found.prior["gyro_scale"] == pytest.approx(base.prior["gyro_scale"], rel=0.5)
    assert found.prior["gyro_misalignment"] == base.prior["gyro_misalignment"]


def test_what_does_not_fit_is_set_apart_with_a_line_each(batch, capsys):
    folder = batch(units=6)
    one = read_result(folder / "unit0_0")
    write_result(folder / "frame" / "result.json", replace(one, body_frame="prior"))
    write_result(folder / "other" / "result.json", replace(one, origin=replace(one.origin, imu="fog_tactical")))
    write_result(folder / "model" / "result.json", replace(one, model=(*one.model, "accel_quadratic")))
    write_result(folder / "twice" / "result.json", one)
    write_result(folder / "grave" / "result.json", replace(one, warnings=("not to be trusted: too short",)))
    (folder / "torn").mkdir()
    (folder / "torn" / "result.json").write_text("{")
    fleet([folder])
    told = [line for line in capsys.readouterr().out.splitlines() if line.startswith("set apart")]
    assert len(told) == 6
    for word in (
        "body frame is prior",
        "IMU file is fog_tactical",
        "+ accel_quadratic",
        "is of the recording of",
        "not to be trusted",
        "not a JSON file",
    ):
        assert sum(word in line for line in told) == 1, word


def test_a_recording_counts_once_where_a_joint_result_has_it(batch):
    folder = batch(units=3)
    one = read_result(folder / "unit1_0")
    origin, none = one.origin, np.full(len(one.names), np.nan)
    recording = SetRecording(
        "bag", origin.serial, origin.power_on, origin.start_ns, 21.0, 60.0, one.data["samples"], 1.0, none, none, none
    )
    of_set = SetSummary((recording,), (), (), none, ())
    joint = replace(one, origin=replace(origin, power_on="", recording=""), of_set=of_set)
    write_result(folder / "joint" / "result.json", joint)
    found = gather([folder])
    assert {entry.name for entry in found.entries} == {"unit0_0", "joint", "unit2_0"}
    assert found.apart == ("unit1_0: its recording is one of the set joint, which is counted",)


def test_a_recording_counts_where_the_joint_result_that_has_it_does_not(batch):
    """Its unit was lost: the recording was set apart for the set, and the set for its model."""
    folder = batch(units=3)
    one = read_result(folder / "unit1_0")
    origin, none = one.origin, np.full(len(one.names), np.nan)
    recording = SetRecording(
        "bag", origin.serial, origin.power_on, origin.start_ns, 21.0, 60.0, one.data["samples"], 1.0, none, none, none
    )
    joint = replace(one, model=(*one.model, "accel_quadratic"), of_set=SetSummary((recording,), (), (), none, ()))
    write_result(folder / "joint" / "result.json", joint)
    found = gather([folder])
    assert {entry.name for entry in found.entries} == {"unit0_0", "unit1_0", "unit2_0"}
    (apart,) = found.apart
    assert apart.startswith("joint: other model (+ accel_quadratic)")


@pytest.mark.parametrize("alone", [[], {"labels": 3}, {"labels": ["a"], "display_units": ["ppm"], "estimates": ["x"]}])
def test_a_diagnosis_that_says_nothing_readable_says_nothing(batch, alone):
    folder = batch(units=3)
    for path in folder.rglob("result.json"):
        write_json(path.with_name("diagnosis.json"), {"format": "sdimu-diagnosis/1", "fit": 5, "alone": alone})
    assert candidates(gather([folder]).given).names == ()


def test_units_without_serial_are_units_of_their_own(batch):
    folder = batch(units=4)
    for path in folder.rglob("result.json"):
        one = read_result(path)
        write_result(path, replace(one, origin=replace(one.origin, serial="")))
    assert {entry.unit for entry in gather([folder]).entries} == {f"unit{k}_0" for k in range(4)}


def test_too_few_units_and_an_empty_folder_are_refused_with_what_to_do(batch, tmp_path):
    with pytest.raises(DataError, match="needs 3 units"):
        fleet([batch(units=2, each=3)])
    (tmp_path / "empty").mkdir()
    with pytest.raises(DataError, match="sdimu calibrate"):
        fleet([tmp_path / "empty"])
    with pytest.raises(DataError, match="no such file"):
        fleet([tmp_path / "nowhere"])


def test_an_effect_too_weak_for_one_unit_is_found_in_their_diagnoses(batch, capsys, tmp_path):
    folder = batch(units=12)
    rng = np.random.default_rng(2)
    unit = to_si(1.0, "ug/g^2")
    labels = [f"accel_quadratic_{axis}" for axis in "xyz"] + [f"accel_cubic_{axis}" for axis in "xyz"]
    for path in folder.rglob("result.json"):
        estimates = unit * (rng.standard_normal(6) + np.array([0.0, 2.0, 0.0, 0.0, 0.0, 0.0]))
        write_json(
            path.with_name("diagnosis.json"),
            {
                "format": "sdimu-diagnosis/1",
                "fit": {"before": {"model": list(read_result(path).model)}},
                "alone": {
                    "labels": labels,
                    "units": ["m/s^2/g^2"] * 3 + ["m/s^2/g^3"] * 3,
                    "display_units": ["ug/g^2"] * 3 + ["ug/g^3"] * 3,
                    "estimates": estimates.tolist(),
                    "sigmas": [unit] * 6,
                    "correlations": packed(np.eye(6)),
                },
            },
        )
    alone = candidates(gather([folder]).given)
    assert alone.estimates.shape == (12, 6)
    fleet([folder], out=tmp_path / "pages")
    assert "Common to the type: accel_quadratic_y, mean +" in capsys.readouterr().out.replace("\n", " ")
    found = json.loads((tmp_path / "pages" / "fleet.json").read_text())["common_effects"]
    assert [one["name"] for one in found if one["named"]] == ["accel_quadratic_y"]
    assert abs(found[0]["mean"] - 2.0 * unit) < 4.0 * found[0]["mean_sigma"]


def test_correlations_come_back_to_a_half_step():
    rng = np.random.default_rng(5)
    W = rng.standard_normal((30, 7))
    J = W.T @ W
    unit = 1.0 / np.sqrt(np.diag(J))
    again = unpacked(packed(J), 7)
    assert np.abs(again / 127.0 - J * np.outer(unit, unit)).max() <= 0.5 / 127.0 + 1e-12


@pytest.mark.parametrize("text", ["", "not base64!", "AAAA"])
def test_correlations_that_are_none_are_none(text):
    assert unpacked(text, 7) is None


def test_priors_are_added_to_an_imu_file_alone(batch, tmp_path):
    folder = batch(units=3)
    (tmp_path / "plan.yaml").write_text("format: sdimu-imu/1\nname: no noise\n")
    with pytest.raises(DataError, match=r"plan\.yaml: noise: missing key"):
        fleet([folder], imu=str(tmp_path / "plan.yaml"), priors=tmp_path / "own.yaml")
    assert not (tmp_path / "own.yaml").exists()
