"""The verb run: what it refuses, and that a refused run leaves everything as it was."""

import math
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from sdimu_calibration.cli.console import plain
from sdimu_calibration.cli.processes import own_domain, own_folder
from sdimu_calibration.core.advice import Advice, Kind
from sdimu_calibration.core.diagnosis.advice import Reason, Untestable, reason
from sdimu_calibration.core.diagnosis.plan_seen import PlanSeen, TurnSeen
from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.config import load_plan
from sdimu_calibration.storage.files.journal import JOURNAL
from sdimu_sim.cli.run import LiveTest, _clear, _tell_choices, _write_plan, run, without_scolding


@dataclass(frozen=True)
class Summary:
    """What of a diagnosis tells what to drive."""

    advice: tuple[Advice, ...]
    untestable: tuple[Untestable, ...]


@pytest.fixture
def invoke(tmp_path, monkeypatch):
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))  # locks of this test alone
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "result.json").write_text("earlier")
    app = typer.Typer()
    app.command()(run)
    yield lambda *options: CliRunner().invoke(app, ["--out", str(tmp_path / "run"), *options])
    assert (tmp_path / "run" / "result.json").read_text() == "earlier"


def test_a_domain_that_is_taken_removes_no_earlier_result(invoke, tmp_path):
    with own_domain(tmp_path / "other", 23):
        refused = invoke("--domain", "23").exception
    assert isinstance(refused, DataError)
    assert "ROS domain 23 holds another run" in str(refused)


def test_a_second_run_into_the_same_folder_is_refused_in_one_line(invoke, tmp_path):
    with own_folder(tmp_path / "run"):
        refused = invoke().exception
    assert isinstance(refused, DataError)
    assert str(refused).startswith(f"{tmp_path / 'run'}: another sdimu run")
    assert "\n" not in str(refused)
    with own_folder(tmp_path / "run"):  # the first has ended
        pass


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--ask",), "--ask: "),
        (("--tell", "gyro_bias_x"), "--tell: "),
        (("--adaptive", "table33", "--tell", "gyro_bias_x"), "two coefficients or more"),
        (("--plan", "kim18", "--adaptive", "table33"), "state one"),
        (("--effect", "gyro_bias_warm_up_y=3 deg/h"), "such as 'gyro_bias_warm_up_y(tau=1200 s)=3 deg/h'"),
    ],
)
def test_options_that_exclude_or_lack_each_other_are_refused(invoke, options, words):
    refused = invoke(*options).exception
    assert isinstance(refused, DataError)
    assert words in str(refused)


def test_a_negative_seed_is_wrong_usage(invoke):
    refused = invoke("--seed", "-1")
    assert refused.exit_code == 2
    assert "--seed" in refused.output


@pytest.mark.parametrize(("own", "left"), [(False, False), (True, True)])
def test_the_plan_of_an_earlier_run_goes_and_the_one_that_is_followed_stays(tmp_path, own, left):
    out = tmp_path / "again"
    (out / "log").mkdir(parents=True)
    (out / "log" / "rate_table.yaml").touch()
    (out / "plan.yaml").touch()
    _clear(out, str(out / "plan.yaml") if own else "kim18")
    assert (out / "plan.yaml").exists() == left


def test_the_plan_that_was_run_is_left_with_the_results(tmp_path):
    _write_plan(tmp_path, tmp_path, LiveTest(plan="kim18_signed"), None)
    written, ran = load_plan(str(tmp_path / "plan.yaml")), load_plan("kim18_signed")
    assert written.dwell_s == ran.dwell_s
    np.testing.assert_allclose([t.angle_rad for t in written.turns], [t.angle_rad for t in ran.turns])


@pytest.mark.usefixtures("invoke")
@pytest.mark.parametrize(("file", "words"), [("metadata.yaml", "sdimu run did not make"), ("notes.txt", "not a bag")])
def test_what_is_in_the_place_of_the_bag_is_kept_and_so_is_the_result(tmp_path, file, words):
    (tmp_path / "run" / "bag").mkdir()
    (tmp_path / "run" / "bag" / file).touch()
    with pytest.raises(DataError, match=words):
        _clear(tmp_path / "run")


def test_results_of_an_earlier_run_are_removed_once_nothing_refuses(tmp_path):
    (tmp_path / "log").mkdir()
    for name in ("log/rate_table.yaml", "result.json", "report.html", "kept"):
        (tmp_path / name).touch()
    _clear(tmp_path)
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["kept", "log"]


def test_a_run_into_the_folder_of_an_earlier_one_asks_for_replace(tmp_path):
    (tmp_path / "log").mkdir()
    (tmp_path / "bag").mkdir()
    for name in ("log/rate_table.yaml", "bag/metadata.yaml", "result.json"):
        (tmp_path / name).touch()
    with pytest.raises(DataError, match="--replace"):
        _clear(tmp_path)
    assert (tmp_path / "result.json").exists()
    _clear(tmp_path, replace=True)
    assert not (tmp_path / "result.json").exists()


@pytest.mark.parametrize("name", ["plan.yaml", "truth.yaml"])
def test_a_run_leaves_files_of_the_user_in_a_folder_of_no_earlier_run(tmp_path, name):
    (tmp_path / name).write_text("# by hand\n")
    with pytest.raises(DataError, match=f"{name}: .*is there"):
        _clear(tmp_path)
    assert (tmp_path / name).read_text() == "# by hand\n"


def test_a_run_keeps_the_journal_of_a_live_test_and_removes_that_of_an_earlier_run(tmp_path):
    (tmp_path / JOURNAL).write_text("samples")
    _clear(tmp_path)
    assert [file.read_text() for file in tmp_path.iterdir()] == ["samples"]
    (tmp_path / "log").mkdir()
    (tmp_path / "log" / "rate_table.yaml").touch()
    (tmp_path / JOURNAL).touch()
    _clear(tmp_path)
    assert not (tmp_path / JOURNAL).exists()


def test_no_reason_tells_a_test_that_chose_its_turns_what_to_drive():
    plan = PlanSeen(tuple(TurnSeen(axis, axis, 1.6, 0.2, 0.2) for axis in range(3)), 0, 1.0)
    families = [effect.family or effect.name for effect in map(registry.get, registry.names()) if effect.excitation]
    seen = [SimpleNamespace(family=one, retention=0.0, smallest=math.inf, partners=()) for one in families]
    reasons = {Untestable(reason(one, plan), ("a",)) for one in seen}
    told = without_scolding(Summary((), tuple(reasons)), "table33").untestable
    asking = ("drive ", "needs turns", "split turns")
    assert all(word in " ".join(one.reason for one in reasons) for word in asking)
    assert [one.reason for one in told if any(word in one.reason for word in asking)] == []


def test_turns_that_the_test_chose_itself_are_not_scolded():
    kept = Advice(Kind.REPEAT_STOPS)
    told = Summary(
        (Advice(Kind.SIGNED_TURNS, ("all turns are positive",)), kept, Advice(Kind.TWO_RATES, ("one rate",))),
        (Untestable(Reason("all turns", "drive others"), ("a",)), Untestable(Reason("coefficients take it"), ("b",))),
    )
    assert [one.reason for one in without_scolding(told, "table33").untestable] == ["all turns", "coefficients take it"]
    assert without_scolding(told, "table33").advice == (kept,)
    assert without_scolding(told, None) == told


@pytest.mark.parametrize(
    "choices",
    [
        "[]",
        "[1]",
        "{}",
        '[{"text": "end"}]',
        *(f'[{{"until_s": {until}, "text": "", "reached": true}}]' for until in ('"x"', "1" * 400, "NaN", "-1")),
    ],
)
def test_choices_that_are_none_are_refused_in_one_line(tmp_path, choices):
    path = tmp_path / "choices.json"
    path.write_text(f'{{"format": "sdimu-choices/1", "choices": {choices}}}')
    with pytest.raises(DataError, match=r"choices\.json: choices: expected"):
        _tell_choices(plain(), path)
