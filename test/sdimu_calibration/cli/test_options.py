"""Options in groups: typer sees each field, verbs get whole objects, and each option is declared in one place."""

from __future__ import annotations

import ast
from collections import Counter
from dataclasses import dataclass, field
from inspect import signature
from pathlib import Path
from typing import Annotated

import pytest
import typer
from typer.testing import CliRunner

from sdimu_calibration.cli import options as shared
from sdimu_calibration.cli.option_groups import with_options, words_of
from sdimu_calibration.cli.options import FitRequest, Fitted, Recorded, StatedOpening
from sdimu_calibration.cli.set_run import SetRequest, calibrate_together
from sdimu_calibration.core.recording import DataError

CLI = Path(shared.__file__).parent


@dataclass(frozen=True)
class Size:
    """Options of a verb of this test."""

    width: Annotated[float, typer.Option(help="Wide.")]
    name: Annotated[list[str] | None, typer.Option(help="Named.")] = None
    deep: Annotated[bool, typer.Option("--deep", help="Deep.")] = False


@dataclass
class Seen:
    calls: list[tuple] = field(default_factory=list)


SEEN = Seen()


@with_options
def verb(bag: Annotated[str, typer.Argument()], size: Size, seed: Annotated[int, typer.Option()] = 1) -> None:
    """Say nothing."""
    SEEN.calls.append((bag, size, seed))


def typed(*words: str):
    app = typer.Typer()
    app.command()(verb)
    return CliRunner().invoke(app, list(words))


def test_a_verb_gets_its_groups_from_the_command_line():
    assert typed("b", "--width", "2", "--name", "x", "--name", "y", "--deep", "--seed", "4").exit_code == 0
    assert SEEN.calls.pop() == ("b", Size(2.0, ["x", "y"], True), 4)


def test_a_verb_gets_its_groups_from_python():
    verb("b", width=3.0)
    assert SEEN.calls.pop() == ("b", Size(3.0), 1)
    with pytest.raises(TypeError, match="height"):
        verb("b", width=3.0, height=1.0)
    with pytest.raises(TypeError, match="width"):
        verb("b")


@pytest.mark.parametrize("words", [["b"], ["b", "--width", "wide"], ["b", "--width", "2", "--height", "3"]])
def test_wrong_use_is_told_as_of_any_option(words):
    done = typed(*words)
    assert done.exit_code == 2
    assert not SEEN.calls


def test_options_stand_where_their_group_stands():
    assert list(signature(verb).parameters) == ["bag", "width", "name", "deep", "seed"]


def test_what_nobody_stated_is_in_no_command():
    assert words_of(Size(2.0), Size) == ["--width", "2.0"]
    assert words_of(Size(2.0, ["x", "y"], True), Size) == ["--width", "2.0", "--name", "x", "--name", "y", "--deep"]
    assert (
        words_of(StatedOpening(), StatedOpening)
        == words_of(Recorded(), Recorded)
        == words_of(FitRequest(), Fitted)
        == []
    )


def test_a_command_repeats_all_that_was_stated_of_a_recording():
    names = list(signature(StatedOpening).parameters)
    stated = StatedOpening(**{name: f"a {name}" for name in names})
    assert words_of(stated, StatedOpening) == [w for n in names for w in (f"--{n.replace('_', '-')}", f"a {n}")]


@pytest.mark.parametrize(
    ("stated", "told"),
    [
        ({"exclude_stops": "4,x"}, "--exclude-stops 4,x"),
        ({"exclude_times": "9"}, "--exclude-times 9"),
        ({"noise": "paper"}, "--noise paper"),
        ({"whole_turns": "0 deg"}, "--whole-turns 0 deg"),
        ({"site": "nowhere"}, "nowhere"),
        ({"imu": "nothing"}, "nothing"),
    ],
)
def test_a_wrong_option_is_told_before_the_recording_is_read(stated, told):
    with pytest.raises(DataError, match=told):
        StatedOpening(**stated).read(None)


def test_a_set_refuses_noise_that_is_not_estimated(tmp_path):
    asked = SetRequest([tmp_path / "a", tmp_path / "b"], StatedOpening(noise="paper"), FitRequest(out=tmp_path / "out"))
    with pytest.raises(DataError, match="--noise paper: expected 'estimated'"):
        calibrate_together(asked)


def test_no_two_verbs_declare_the_same_option():
    calls = [
        node
        for path in CLI.glob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and ast.unparse(node.func) in {"typer.Option", "typer.Argument"}
    ]
    assert len(calls) > 50
    same = Counter(ast.unparse(call) for call in calls)
    assert [text for text, count in same.items() if count > 1] == []


@pytest.mark.parametrize(("estimator", "asked"), [("auto", "handheld"), ("handheld", "handheld"), ("hand", "handheld")])
def test_by_hand_is_the_estimator_of_a_run_by_hand(estimator, asked):
    assert Fitted(estimator=estimator, hand=True).asked_estimator == asked


@pytest.mark.parametrize("estimator", ["classical", "nosuch"])
def test_an_unknown_estimator_is_refused_with_those_that_there_are(estimator):
    with pytest.raises(DataError, match=f"^--estimator {estimator}: expected one of auto, filter, handheld, batch$"):
        _ = Fitted(estimator=estimator).asked_estimator


@pytest.mark.parametrize("estimator", ["filter", "second-order", "batch"])
def test_by_hand_excludes_the_estimators_of_a_table(estimator):
    with pytest.raises(typer.BadParameter, match="leave out one of both"):
        _ = Fitted(estimator=estimator, hand=True).asked_estimator
