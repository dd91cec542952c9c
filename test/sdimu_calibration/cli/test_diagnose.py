"""`sdimu diagnose` end to end: the hidden effect is found, added, and the error falls; compare shows it."""

from __future__ import annotations

import json
import re
import socket
import sys

import numpy as np
import pytest
from plans import quick_plan

from sdimu_calibration.cli import main as cli
from sdimu_calibration.core.effects import registry
from sdimu_calibration.report.catalogue import page
from sdimu_calibration.storage.bags.bag_writer import BagContent, write_recording
from sdimu_calibration.storage.files.config import load_imu, load_site
from sdimu_sim.core.scenario import Scenario, generate

OWN = """\
format: sdimu-effect/1
name: bent
expressions: {accel_y: k * ay**2}
parameters:
  k: {unit: ug/g^2, prior: 30 ug/g^2}
"""


@pytest.fixture
def sdimu(monkeypatch, capsys):
    """Run `sdimu` in this process; return exit status, stdout, stderr."""

    def run(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["sdimu", *map(str, arguments)])
        monkeypatch.setenv("COLUMNS", "80")
        with pytest.raises(SystemExit) as ending:
            cli.main()
        captured = capsys.readouterr()
        return int(ending.value.code or 0), captured.out, captured.err

    return run


@pytest.fixture(scope="module")
def hidden(tmp_path_factory):
    """Bag of a short test with a quadratic term of the y accelerometer hidden in it."""
    scenario = Scenario(
        quick_plan(),
        load_imu("dtg"),
        load_site("daejeon"),
        rate_hz=20.0,
        seed=401,
        effects=("accel_quadratic_y=200 ug/g^2",),
    )
    recording, _ = generate(scenario)
    path = tmp_path_factory.mktemp("bags") / "hidden"
    write_recording(
        path,
        BagContent(
            start_ns=recording.start_ns,
            imu_ns=np.round(recording.t * 1e9).astype(np.int64),
            omega_ib_b=recording.omega_ib_b,
            f_ib_b=recording.f_ib_b,
            status=(np.round(recording.phase.t * 1e9).astype(np.int64), recording.phase.dwell, recording.phase.stop),
        ),
    )
    return path


def test_a_coefficient_that_is_another_one_is_told_by_a_diagnosis(sdimu, hidden, tmp_path):
    status, out, err = sdimu("diagnose", hidden, "--add", "gyro_x: 1", "--out", tmp_path / "o")
    assert status == 0
    (line,) = [line for line in out.splitlines() if "cannot be told from each other" in line]
    assert line.startswith("note: gyro_bias_x and gyro_x: 1 ")
    assert err.splitlines() == [line.replace("note", "sdimu", 1)]


def test_the_loop_of_diagnosis_addition_and_comparison(sdimu, hidden, tmp_path):
    status, out, err = sdimu("diagnose", hidden, "--out", tmp_path / "d")
    assert (status, err) == (0, "")
    assert out.splitlines()[0].startswith("Certain")
    assert "accel_quadratic_y" in out
    assert "could not have been seen" in out
    found = json.loads((tmp_path / "d" / "diagnosis.json").read_text())
    label = found["candidates"][0]["label"]

    status, out, err = sdimu("calibrate", hidden, "--out", tmp_path / "base")
    assert status == 3
    assert "not to be trusted: the model" in err
    assert "does not fit" in err
    assert "To learn what the model misses:\n  sdimu diagnose " in out
    status, out, _ = sdimu("calibrate", hidden, "--add", label, "--out", tmp_path / "more")
    assert status == 0
    looked_for = out.replace("\n", " ").partition("Nobody has looked for small effects that the model lacks")[2]
    assert f"To look:   sdimu diagnose {hidden} --add {label}" in looked_for
    fits = [json.loads((tmp_path / n / "result.json").read_text())["fit"] for n in ("base", "more")]
    assert fits[1]["held_out_rms"] < fits[0]["held_out_rms"]
    assert fits[1]["log_likelihood"] > fits[0]["log_likelihood"]

    status, out, _ = sdimu("compare", tmp_path / "base", tmp_path / "more")
    assert status == 0
    assert f"+ {label}" in out
    assert "accel_bias_y" in out  # what the missing term had bent


def test_an_effect_by_file_is_added_like_any_other(sdimu, hidden, tmp_path):
    (tmp_path / "own.yaml").write_text(OWN)
    assert sdimu("calibrate", hidden, "--add", tmp_path / "own.yaml", "--out", tmp_path / "o")[0] == 0
    result = json.loads((tmp_path / "o" / "result.json").read_text())
    assert "bent_k" in {c["name"] for c in result["coefficients"]}


def test_bad_input_is_one_line(sdimu, hidden, tmp_path):
    (tmp_path / "bad.yaml").write_text(OWN.replace("ay**2", "ay"))
    bad = tmp_path / "bad.yaml"
    for option, value, word in (("--add", "accel_quadratik", "did you mean"), ("--try", bad, "bad.yaml")):
        status, out, err = sdimu("diagnose", hidden, option, value, "--out", tmp_path / "x")
        assert (status, out) == (1, "")
        assert err.count("\n") == 1
        assert word in err
    assert not (tmp_path / "x").exists()


def test_the_page_of_effects_tells_every_effect_of_the_registry(sdimu):
    status, out, _ = sdimu("effects", "--markdown")
    assert (status, out.strip()) == (0, page().strip())
    assert set(registry.names()) == set(re.findall(r"^### (\w+)$", out, re.MULTILINE))


def _free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def test_a_run_by_hand_is_diagnosed_by_its_own_fit(sdimu, tmp_path):
    bag = tmp_path / "hand"
    effect = "accel_quadratic_x=4000 ug/g^2"
    making = ("simulate", "--by-hand", 20, "--imu", "mems_by_hand", "--seed", 7, "--effect", effect, "--out", bag)
    assert sdimu(*making)[0] == 0
    status, out, err = sdimu("diagnose", bag, "--imu", "mems_by_hand", "--out", tmp_path / "d")
    assert (status, err) == (0, "")
    assert "nothing is navigated" in out
    assert any(line.startswith(("Certain", "Likely")) for line in out.splitlines())
    found = json.loads((tmp_path / "d" / "diagnosis.json").read_text())
    (one,) = found["candidates"]
    assert "accel_quadratic_x" in {one["label"], *one["indistinguishable_from"]}
    page = (tmp_path / "d" / "report.html").read_text()
    for words in ("Effects: what is missing", "Where it fails: channel by rest", "Ladder of models"):
        assert words in page
    more = ("calibrate", bag, "--imu", "mems_by_hand", "--add", one["label"], "--out", tmp_path / "c")
    assert sdimu(*more)[0] == 0
    again = json.loads((tmp_path / "c" / "result.json").read_text())
    (there,) = (c for c in again["coefficients"] if c["name"] == one["parameters"][0]["name"])
    assert there["value"] == pytest.approx(one["parameters"][0]["value"], abs=0.02 * there["sigma"])

    status, out, err = sdimu("diagnose", bag, "--imu", "mems_by_hand", "--bootstrap", 5, "--out", tmp_path / "x")
    assert (status, err.count("\n")) == (1, 1)
    assert "--bootstrap" in err
    status, out, err = sdimu("workbench", bag, "--imu", "mems_by_hand", "--port", _free_port())
    assert (status, err.count("\n")) == (1, 1)
    assert "sdimu diagnose" in err
