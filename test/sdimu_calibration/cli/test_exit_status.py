"""Exit status 3: done, but the estimate is not to be trusted, and stderr says why."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import typer

from sdimu_calibration.cli import main as cli
from sdimu_calibration.cli.compensate import compensate
from sdimu_calibration.cli.export import export
from sdimu_calibration.cli.opened import leave
from sdimu_calibration.core.diagnosis import diagnose as of_one
from sdimu_calibration.core.diagnosis import rounds
from sdimu_calibration.core.diagnosis.screen import screen
from sdimu_calibration.core.diagnosis.verdict import Facts, verdict
from sdimu_calibration.core.estimation.noise_estimate import not_of_sensors
from sdimu_calibration.core.joint import set_diagnosis as of_set
from sdimu_calibration.core.joint import set_search
from sdimu_calibration.core.noise_term import RANDOM_WALK, SHIFT, NoiseTerm, unexplained
from sdimu_calibration.core.recording import DataFault
from sdimu_calibration.core.results import Calibration, no_history
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.storage.files.result_file import as_note, read_judged_result, write_result
from sdimu_sim.cli.run import _leave as leave_run
from sdimu_sim.cli.simulate import simulate

FITS = Calibration(
    "prior",
    ("accel_bias",),
    ("accel_bias_x",),
    ("m/s^2",),
    ("ug",),
    np.array([1e-4]),
    np.array([[1e-12]]),
    {"nis_mean": 1.0},
    {},
    (),
    no_history(1),
)
MISFITS = tuple(
    map(
        as_note,
        (
            "the model in white noise does not fit (NIS 5.6; 1 is right); run: sdimu diagnose",
            "stop 3 does not fit: gyro is off by 9.1 sigma (chance ends at 5); look at the data there, or run: "
            "sdimu diagnose",
            "gyro_scale_y is not the same in all recordings (p 1e-09); run: sdimu diagnose",
        ),
    )
)
UNTRUSTED = ("unexplained", "data fault")
TRUSTED = ("consistent", "noise model wrong", "one effect", "class of effects", "several effects", "own equation")
PLAN = """format: sdimu-plan/1
name: small
dwell: 20 s
rate: 10 deg/s
acceleration: 20 deg/s^2
turns:
  - {axis: Y, angle: 90 deg}
  - {axis: Y, angle: 180 deg}
  - {axis: Y, angle: -180 deg}
  - {axis: Z, angle: 90 deg}
  - {axis: X, angle: 90 deg}
  - {axis: X, angle: -180 deg}
"""


def left(capsys, *arguments):
    """Exit status, and what was said on stderr."""
    try:
        leave(*arguments)
    except typer.Exit as ending:
        return ending.exit_code, capsys.readouterr().err
    return 0, capsys.readouterr().err


@pytest.mark.parametrize("warning", MISFITS)
def test_a_misfit_that_a_calibration_notes_ends_with_3(capsys, warning):
    assert left(capsys, replace(FITS, warnings=(warning,))) == (3, f"sdimu: not to be trusted: {warning}\n")


def test_the_whole_command_of_a_diagnosis_stands_once_in_the_place_of_advice_without_recordings(capsys):
    status, err = left(capsys, replace(FITS, warnings=MISFITS), None, "sdimu diagnose a b")
    assert status == 3
    assert "run: sdimu diagnose" not in err
    assert err.splitlines()[-1] == "sdimu: to learn what the model misses: sdimu diagnose a b"
    assert left(capsys, FITS, None, "sdimu diagnose a b") == (0, "")


def test_what_fits_ends_with_0_whatever_else_it_warns_of(capsys):
    assert left(capsys, FITS) == (0, "")
    assert left(capsys, replace(FITS, warnings=("accel_bias_x is 7 sigma outside the specification",))) == (0, "")


@pytest.mark.parametrize("verdict", UNTRUSTED)
def test_a_verdict_that_leaves_the_model_wrong_ends_with_3(capsys, verdict):
    status, err = left(capsys, FITS, (verdict, "Something is wrong."))
    assert (status, err) == (3, f"sdimu: not to be trusted: {verdict}: Something is wrong.\n")


@pytest.mark.parametrize("verdict", TRUSTED)
def test_a_diagnosis_that_ends_in_a_right_model_judges_the_misfit(capsys, verdict):
    assert left(capsys, replace(FITS, warnings=MISFITS), (verdict, "It is found.")) == (0, "")


@pytest.mark.parametrize("warning", MISFITS)
def test_a_run_whose_result_does_not_fit_ends_with_3(capsys, warning):
    with pytest.raises(typer.Exit) as ending:
        leave_run(replace(FITS, warnings=(warning,)), None, None)
    assert ending.value.exit_code == 3
    assert capsys.readouterr().err == f"sdimu: not to be trusted: {warning}\n"
    leave_run(FITS, "table33", {"reached": True, "text": "done"})


def test_a_run_says_both_that_it_missed_its_limits_and_that_it_does_not_fit(capsys):
    with pytest.raises(typer.Exit) as ending:
        leave_run(replace(FITS, warnings=MISFITS[:1]), "table33", {"reached": False, "text": "time is up"})
    err = capsys.readouterr().err
    assert ending.value.exit_code == 3
    assert "the limits of table33 were not reached: time is up" in err
    assert f"not to be trusted: {MISFITS[0]}" in err


@pytest.mark.parametrize("verdict", [None, *UNTRUSTED, *TRUSTED])
def test_a_result_tells_those_who_use_it_that_it_is_not_to_be_trusted(tmp_path, verdict):
    write_result(tmp_path / "result.json", replace(FITS, warnings=MISFITS), verdict and Verdict(verdict))
    _, reasons = read_judged_result(tmp_path)
    path = tmp_path / "result.json"
    if verdict is None:
        assert reasons == tuple(f"{path}: {line}" for line in MISFITS)
    elif verdict in UNTRUSTED:
        assert len(reasons) == 1
        assert reasons[0].startswith(f"{path}: its diagnosis ended as '{verdict}'")
    else:
        assert reasons == ()


def test_a_result_that_fits_is_used_without_a_word(tmp_path):
    write_result(tmp_path / "result.json", FITS)
    assert read_judged_result(tmp_path)[1] == ()


def test_a_fault_of_the_data_is_said_once(capsys):
    fault = DataFault("spike", "12 spikes", grave=True)
    status, err = left(capsys, replace(FITS, faults=(fault,)), ("data fault", "The data have a fault: 12 spikes."))
    assert (status, err.count("12 spikes")) == (3, 1)


@pytest.fixture(scope="module")
def bags(tmp_path_factory):
    """Two short recordings of one unit, with the same hidden effect."""
    folder = tmp_path_factory.mktemp("status")
    (folder / "small.yaml").write_text(PLAN)
    for number in (1, 2):
        simulate(
            plan=str(folder / "small.yaml"),
            rate=20.0,
            seed=number,
            unit=1,
            effect=["gyro_scale_asymmetry_y=200 ppm"],
            out=folder / f"bag{number}",
        )
    return [folder / "bag1", folder / "bag2"]


@pytest.fixture
def sdimu(monkeypatch, capsys, tmp_path):
    """Run `sdimu` in this process with --json; return exit status, the answer and stderr."""

    def run(*arguments):
        argv = ["sdimu", *map(str, arguments), "--imu", "dtg", "--json", "--out", str(tmp_path / "out")]
        monkeypatch.setattr(sys, "argv", argv)
        capsys.readouterr()
        with pytest.raises(SystemExit) as ending:
            cli.main()
        captured = capsys.readouterr()
        return int(ending.value.code or 0), json.loads(captured.out), captured.err

    return run


@pytest.mark.parametrize("number", [1, 2])
def test_calibrate_without_the_effect_ends_with_3_and_with_it_with_0(sdimu, bags, number):
    status, answer, err = sdimu("calibrate", *bags[:number])
    assert (status, answer["format"]) == (3, "sdimu-result/1")
    assert "not to be trusted: the model" in err
    # Of a set "run: sdimu diagnose" named no recordings.
    assert number == 1 or f"\nsdimu: to learn what the model misses: sdimu diagnose {bags[0]} {bags[1]} " in err
    status, _, err = sdimu("calibrate", *bags[:number], "--add", "gyro_scale_asymmetry_y")
    assert status == 0, err


def test_a_batch_that_does_not_explain_its_data_ends_with_3(sdimu, bags):
    status, _, err = sdimu("calibrate", bags[0], "--estimator", "batch")
    assert (status, "not to be trusted: the model does not fit" in err) == (3, True)
    sound = bags[0].with_name("sound")
    simulate(plan=str(bags[0].with_name("small.yaml")), rate=20.0, seed=1, out=sound)
    status, _, err = sdimu("calibrate", sound, "--estimator", "batch")
    assert status == 0, err


def test_a_result_that_does_not_fit_is_compensated_and_exported_with_a_warning(sdimu, bags, tmp_path, capsys):
    sdimu("calibrate", bags[0])
    capsys.readouterr()
    export(tmp_path / "out", out=tmp_path / "matrices.txt")
    compensate(bags[0], result=tmp_path / "out", out=tmp_path / "clean")
    err = capsys.readouterr().err
    assert err.count(f"not to be trusted: {tmp_path / 'out' / 'result.json'}: the model") == 2


def once(search):
    """A search that gives every time what it found the first time."""
    found = []

    def kept(*arguments, **options):
        if not found:
            found.append(search(*arguments, **options))
        return found[0]

    return kept


@pytest.mark.parametrize("number", [1, 2])
def test_diagnose_ends_as_its_verdict_says(sdimu, bags, monkeypatch, number):
    # The search comes before the verdict, and is most of the work.
    monkeypatch.setattr(of_one, "searched", once(of_one.searched))
    monkeypatch.setattr(of_set, "searched", once(of_set.searched))
    for word in ("unexplained", "one effect"):
        monkeypatch.setattr(of_one, "verdict", lambda *_, said=word: said)
        monkeypatch.setattr(of_set, "verdict_of_set", lambda *_, said=word: said)
        status, _, err = sdimu("diagnose", *bags[:number])
        assert status == (3 if word == "unexplained" else 0)
        assert (f"not to be trusted: {word}: " in err) == (status == 3)


@pytest.mark.parametrize("kind", ["stuck", "saturated", "spike"])
@pytest.mark.parametrize("grave", [True, False])
def test_both_verbs_judge_a_fault_of_the_data_alike(capsys, kind, grave):
    fault = DataFault(kind, "wrong samples", 3, 1.0, 1.1, grave)
    fit = SimpleNamespace(faults=(fault,), test=SimpleNamespace(recording=SimpleNamespace(rejected=0)))
    (finding,) = screen(fit)
    word = verdict(Facts(grave=finding.grave))
    result = replace(FITS, faults=(fault,))
    of_calibration = left(capsys, result)[0]
    of_diagnosis = left(capsys, result, (word, "The data have a fault: wrong samples."))[0]
    assert of_calibration == of_diagnosis == (3 if grave else 0)


@pytest.mark.parametrize("number", [1, 2])
def test_a_search_that_does_not_settle_ends_with_3(sdimu, bags, monkeypatch, number):
    monkeypatch.setattr(rounds, "MOST_ROUNDS", 1)
    monkeypatch.setattr(set_search, "_MOST_ROUNDS", 1)
    status, _, err = sdimu("diagnose", *bags[:number])
    assert status == 3
    assert "went to and fro" in err


def test_noise_that_no_sensor_has_is_a_misfit_of_a_calibration_as_of_a_diagnosis():
    drawn, walk = NoiseTerm("accel", SHIFT), NoiseTerm("gyro", RANDOM_WALK)
    like_a_walk = replace(drawn, alike=(RANDOM_WALK,))
    assert unexplained([drawn, walk, like_a_walk]) == (drawn,)
    assert unexplained([drawn], ["gap", "spike"]) == ()
    note = not_of_sensors([drawn])
    assert replace(FITS, warnings=(note,)).misfits == (note,)
    assert as_note(str(note)).topic == note.topic
