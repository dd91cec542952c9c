"""The terminal: every verb fits 80 columns, pipes plainly, answers in JSON, and advises what can be pasted."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path
from unittest import mock

import pytest

from sdimu_calibration.cli import main as cli
from sdimu_calibration.cli.console import plain
from sdimu_calibration.cli.next_commands import Asked, print_advice, spelled
from sdimu_calibration.cli.options import FitRequest, StatedOpening
from sdimu_calibration.core.advice import Advice, Kind, Verb
from sdimu_calibration.storage.files.advice_words import sentence

WIDTH = 80
CONTROL = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
BAR = re.compile(r"\x1b\[\?25l.*?\x1b\[\?25h(?:\n?\r?\x1b\[1A\x1b\[2K)*", re.DOTALL)
"""A bar of progress, from the hidden cursor to the line that it erases: it comes where the work takes seconds."""
EFFECT = "gyro_scale_asymmetry_y"
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


@dataclass
class Terminal:
    """A folder with a small recording of a hidden effect, and the program in it."""

    folder: Path

    def __call__(self, *arguments: object, terminal: bool = False) -> subprocess.CompletedProcess[str]:
        """Run the program in this process: its entry, its environment and its streams, without loading numba anew."""
        words, out, err, before = ["sdimu", *map(str, arguments)], StringIO(), StringIO(), Path.cwd()
        status = 0
        with (
            mock.patch.dict(os.environ, self.environment(terminal), clear=True),
            mock.patch.object(sys, "argv", words),
            redirect_stdout(out),
            redirect_stderr(err),
        ):
            os.chdir(self.folder)
            try:
                cli.main()
            except SystemExit as ending:
                status = int(ending.code or 0)
            finally:
                os.chdir(before)
        return subprocess.CompletedProcess(words, status, out.getvalue(), err.getvalue())

    def outside(self, *arguments: object, terminal: bool = False) -> subprocess.CompletedProcess[str]:
        """Run the program as a process of its own."""
        return subprocess.run(
            [sys.executable, "-m", "sdimu_calibration.cli.main", *map(str, arguments)],
            cwd=self.folder,
            env=self.environment(terminal),
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )

    def unread(self, *arguments: object, both: bool = False) -> subprocess.CompletedProcess[str]:
        """Run the program as a process of its own, with a pipe that nobody reads; `both`: for stderr, too."""
        reader, writer = os.pipe()
        os.close(reader)
        try:
            return subprocess.run(
                [sys.executable, "-m", "sdimu_calibration.cli.main", *map(str, arguments)],
                cwd=self.folder,
                env=self.environment(terminal=False),
                stdout=writer,
                stderr=writer if both else subprocess.PIPE,
                text=True,
                timeout=300,
                check=False,
            )
        finally:
            os.close(writer)

    @staticmethod
    def environment(terminal: bool) -> dict[str, str]:
        kept = {k: v for k, v in os.environ.items() if k not in {"NO_COLOR", "FORCE_COLOR", "TERM"}}
        return kept | {"COLUMNS": str(WIDTH), "TTY_COMPATIBLE": "1" if terminal else "0", "TERM": "xterm"}


@pytest.fixture(scope="module")
def sdimu(tmp_path_factory: pytest.TempPathFactory) -> Terminal:
    folder = tmp_path_factory.mktemp("terminal")
    (folder / "small.yaml").write_text(PLAN)
    run = Terminal(folder)
    # Two recordings of one unit, and two more units.
    for number, unit in ((1, 1), (2, 1), (3, 3), (4, 4)):
        making = (
            "simulate",
            "--plan",
            "small.yaml",
            "--rate",
            20,
            "--seed",
            number,
            "--unit",
            unit,
            "--serial",
            f"SN{unit}",
            "--effect",
            f"{EFFECT}=200 ppm",
            "--out",
            f"bag{number}",
        )
        assert run(*making).returncode == 0
        if number != 2:
            made = run("calibrate", f"bag{number}", "--imu", "dtg", "--out", f"results/base{number}")
            assert made.returncode in (0, 3), made.stderr
    assert run("diagnose", "bag1", "--imu", "dtg", "--out", "diagnosis").returncode in (0, 3)
    return run


ANSWERS = {
    "calibrate": (("calibrate", "bag1", "--imu", "dtg", "--out", "again"), "sdimu-result/1"),
    "set": (("calibrate", "bag1", "bag2", "--imu", "dtg", "--out", "both"), "sdimu-result/1"),
    "diagnose": (("diagnose", "bag1", "--imu", "dtg", "--out", "diagnosed"), "sdimu-diagnosis/1"),
    "compare": (("compare", "results/base1", "diagnosis"), "sdimu-comparison/1"),
    "effects": (("effects",), "sdimu-catalogue/1"),
    "effect": (("effects", "gyro_scale"), "sdimu-catalogue/1"),
    "predict": (("predict", "--plan", "small.yaml"), "sdimu-prediction/1"),
    "plan": (("plan", "--plan", "small.yaml", "--tries", 2, "--replace"), "sdimu-plan-search/1"),
    "tell": (
        ("plan", "--plan", "small.yaml", "--tell", EFFECT, "--tell", "gyro_scale_quadratic_y"),
        "sdimu-next-turn/1",
    ),
    "noise": (("noise", "bag1", "--out", "noise"), "sdimu-noise-terms/1"),
    "info": (("bag", "info", "bag1"), "sdimu-bag-info/1"),
    "fleet": (("fleet", "results", "--out", "fleet"), "sdimu-fleet/1"),
    "datasheet": (("datasheet", "results", "--out", "sheet"), "sdimu-datasheet/1"),
}
"""What prints figures, with small data, and the format of its answer."""


def too_wide(text: str) -> list[str]:
    """Lines that do not fit, but for commands to paste, which stand alone, and names without a place to break."""
    lines = CONTROL.sub("", text.replace("\r", "\n")).splitlines()
    return [line for line in lines if len(line) > WIDTH and " " in line.strip() and not line.startswith("  sdimu ")]


@pytest.mark.parametrize("verb", ANSWERS)
def test_a_verb_fits_the_window(sdimu, verb):
    shown = sdimu(*ANSWERS[verb][0], terminal=True)
    assert shown.returncode in (0, 3), shown.stderr
    assert shown.stdout.strip()
    assert too_wide(shown.stdout) == []
    assert "…" not in shown.stdout


@pytest.mark.parametrize("verb", ANSWERS)
def test_a_verb_answers_in_json_alone_as_its_file_does_and_speaks_plainly_beside_it(sdimu, verb):
    arguments, kind = ANSWERS[verb]
    done = sdimu(*arguments, "--json")
    assert done.returncode in (0, 3), done.stderr
    content = json.loads(done.stdout)
    assert content["format"] == kind
    if "--out" in arguments:
        folder = sdimu.folder / str(arguments[arguments.index("--out") + 1])
        assert content in [json.loads(path.read_text()) for path in folder.glob("*.json")]
    # What a pipe without --json would get.
    assert "\x1b" not in done.stderr
    assert "…" not in done.stderr
    rules = [line for line in done.stderr.splitlines() if set(line.strip()) == {"─"}]
    assert all(len(line) <= WIDTH for line in rules)


LEAVES = {
    "calibrate": "again/result.json",
    "set": "both/result.json",
    "diagnose": "diagnosed/diagnosis.json",
    "compare": "results/base1/result.json",
    "predict": "out/predict/prediction.json",
    "plan": "out/plan/found.yaml",
    "noise": "noise/noise.json",
    "fleet": "fleet/fleet.json",
    "datasheet": "sheet/datasheet.json",
}
"""What a verb leaves."""


@pytest.mark.parametrize("verb", LEAVES)
@pytest.mark.parametrize("both", [False, True])
def test_a_reader_that_closes_the_pipe_costs_no_results(sdimu, verb, both):
    """As of ``sdimu diagnose BAG | head -3``, and with stderr in the same pipe: all ends as with a reader."""
    asked, left = ANSWERS[verb][0], sdimu.folder / LEAVES[verb]
    if "--out" in asked or verb == "predict":
        shutil.rmtree(left.parent, ignore_errors=True)
    status = sdimu(*asked).returncode
    if "--out" in asked or verb == "predict":
        shutil.rmtree(left.parent)
    done = sdimu.unread(*asked, both=both)
    assert done.returncode == status
    assert both or "not to be trusted" in done.stderr or not done.stderr
    assert left.is_file()
    assert not list(sdimu.folder.glob("**/*.part"))


def test_a_long_answer_whose_reader_has_gone_ends_quietly(sdimu):
    done = sdimu.unread("effects", "--json")
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("terminal", [False, True])
def test_a_process_of_its_own_says_the_same(sdimu, terminal):
    asked = ("calibrate", "bag1", "--imu", "dtg", "--out", "alone")
    here, outside = sdimu(*asked, terminal=terminal), sdimu.outside(*asked, terminal=terminal)
    # What stays on the screen: on a busy machine one of the two shows how far it is.
    assert BAR.sub("", outside.stdout) == BAR.sub("", here.stdout)
    assert (outside.returncode, outside.stderr) == (here.returncode, here.stderr)


def test_a_pipe_gets_words_without_colour(sdimu):
    done = sdimu.outside("compare", "results/base1", "diagnosis")
    assert done.returncode == 0
    assert EFFECT in done.stdout
    assert "\x1b" not in done.stdout + done.stderr


def test_help_of_every_verb_fits_and_stands_in_the_order_of_work(sdimu):
    words = sdimu.outside("--help").stdout
    panels = ("Simulate and record", "Calibrate", "Diagnose", "Plan", "Use", "Study")
    places = [words.index(f"─ {panel} ─") for panel in panels]
    assert places == sorted(places)
    verbs = re.findall(r"^│ ([a-z][a-z-]*) ", words, re.MULTILINE)
    assert verbs.index("simulate") < verbs.index("calibrate") < verbs.index("diagnose") < verbs.index("compensate")
    for text in (words, *(sdimu.outside(verb, "--help").stdout for verb in ("calibrate", "diagnose", "plan"))):
        assert max(map(len, text.splitlines())) <= WIDTH
        assert "…" not in text


def test_advice_can_be_pasted(sdimu):
    said = sdimu("diagnose", "bag1", "--imu", "dtg", "--out", "pasted").stdout
    commands = [line.strip() for line in said.splitlines() if line.startswith("  sdimu ")]
    assert len(commands) == len(set(commands)) > 0
    # Another test has left a plan here, and no verb replaces what it was not told to replace.
    shutil.rmtree(sdimu.folder / "out" / "plan", ignore_errors=True)
    for line in commands:
        program, *arguments = shlex.split(line)
        assert program == "sdimu"
        # As it was pasted; of a search that would take a quarter of a minute the first plans are enough.
        brief = ("--tries", 3) if "--after" in arguments else ()
        done = sdimu(*arguments, *brief)
        assert done.returncode in (0, 3), f"{line}\n{done.stderr}"
    added = [line for line in commands if line.startswith("sdimu calibrate bag1 --imu dtg --add ")]
    assert len(added) == 1


def test_advice_repeats_what_was_asked_for():
    request = FitRequest(add=["lever_arm"], out=Path("out"), workers=3)
    asked = Asked.of((Path("a bag"),), Path("out"), StatedOpening("my site.yaml", "dtg", gyro_sign=-1), request)
    kept = Advice(Kind.KEEP, ("lever",), Verb.ADD, ("coupling.yaml:k1", "x(tau=3 s)"))
    command = spelled(kept, asked)
    assert sentence(kept) == "Calibrate with lever in the model: --add 'coupling.yaml:k1' --add 'x(tau=3 s)'."
    assert shlex.split(command) == [
        "sdimu",
        "calibrate",
        "a bag",
        "--site",
        "my site.yaml",
        "--imu",
        "dtg",
        "--gyro-sign",
        "-1",
        "--add",
        "lever_arm",
        "--add",
        "coupling.yaml:k1",
        "--add",
        "x(tau=3 s)",
    ]
    request = FitRequest("m", "filter", hand=True, add=["x"])
    full = Asked.of((), Path(), StatedOpening("s", noise="estimated", serial="7"), request)
    words = shlex.join(full.options)
    assert words == "--site s --model m --noise estimated --estimator filter --serial 7 --hand --add x"
    ranked = Advice(Kind.RANK_TURNS, (), Verb.RANK_TURNS, ("a", "b"))
    stated = "(PLAN: name in config/plan, or file, of the plan that the table ran)."
    assert sentence(ranked) == f"Turns ranked by what they tell: sdimu plan --plan PLAN --tell 'a' --tell 'b' {stated}"
    command = spelled(ranked, asked)
    assert shlex.split(command) == [
        "sdimu",
        "plan",
        "--plan",
        "out/plan.yaml",
        "--site",
        "my site.yaml",
        "--imu",
        "dtg",
        "--tell",
        "a",
        "--tell",
        "b",
    ]
    more = Advice(Kind.PLAN_NEXT, (), Verb.CONTINUE)
    assert sentence(more) == "A whole plan of the next recording, for all that is open: sdimu plan --after."
    assert spelled(more, asked) == "sdimu plan --after out"
    back = Advice(Kind.RUN_BACKWARDS, (), Verb.REVERSE_PLAN)
    assert sentence(back).endswith(f"The other order: sdimu plan --plan PLAN --backwards {stated}")
    assert shlex.split(spelled(back, asked))[2:4] == ["--plan", "out/plan.yaml"]
    # Where no plan was seen there is no such file: words say which one is meant.
    unseen = replace(asked, has_plan=False)
    assert spelled(back, unseen) == ""
    with redirect_stdout(StringIO()) as said:
        print_advice(plain(), [ranked], unseen)
    assert " ".join(said.getvalue().split()) == f"advice: {sentence(ranked)}"
    assert spelled(Advice(Kind.LOOK_AT_MOUNT), asked) == ""
