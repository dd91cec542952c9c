"""`sdimu watch` beside `sdimu run`: finds its domain, joins late, has the figures of the run, ends with it, adds."""

from __future__ import annotations

import re
import time
from pathlib import Path
from subprocess import Popen

import pytest

from sdimu_calibration.storage.files.result_file import read_result

from .conftest import DEADLINE_S, sdimu, write_plan

pytestmark = pytest.mark.ros
EFFECT = "gyro_scale_asymmetry_y"
OWN = """\
format: sdimu-effect/1
name: bent_force
expressions:
  accel_x: k * ax**2
parameters:
  k: {unit: ug/g^2, prior: 30 ug/g^2}
"""


def told(text: str, stop: int) -> tuple[str, str]:
    """Place and time of the test, and the first sigma, in the line of a stop."""
    (line,) = (line for line in text.splitlines() if line.startswith(f"stop {stop} "))
    place, when, sigma, *_ = line.split("; ")
    return f"{place}; {when.partition(',')[0]}", sigma


def both_ended(run: Popen[str], watch: Popen[str], folder: Path) -> tuple[str, str]:
    """What a run and the one that watched it have printed, once both have ended as they should."""
    seen, wrong = watch.communicate(timeout=DEADLINE_S)
    assert (watch.returncode, wrong) == (0, "")
    done, err = run.communicate(timeout=DEADLINE_S)
    assert run.returncode in (0, 3), err
    assert f"the run into {folder}" in seen
    assert "the test has ended" in seen
    return done, seen


def start_run(tmp_path: Path, domain: int, dwell_s: float) -> Popen[str]:
    plan = write_plan(tmp_path / "plan.yaml", dwell_s)
    given = ("--plan", plan, "--rate", 20, "--speed", 3, "--no-diagnose", "--domain", domain)
    return sdimu("run", *given, "--out", tmp_path / "run")


def test_watch_finds_the_run_joins_late_adds_and_ends_with_it(tmp_path: Path, apart: int) -> None:
    own = tmp_path / "own.yaml"
    own.write_text(OWN)
    run = start_run(tmp_path, apart, 40.0)
    watch = None
    try:
        begun = time.monotonic()
        while not (tmp_path / "run" / "log" / "calibration.log").exists():
            assert time.monotonic() - begun < DEADLINE_S
            time.sleep(0.2)
        watch = sdimu("watch", "--add", EFFECT, "--add", own)
        done, seen = both_ended(run, watch, tmp_path / "run")
    finally:
        for process in (run, watch):
            if process is not None:
                process.kill()
    for stop in (1, 2):
        one, other = (re.sub(r"\d+ of", "of", told(text, stop)[0]) for text in (done, seen))
        assert one == other
    assert f"the test adds {EFFECT} and {own}: its filter goes through all samples so far again" in seen
    assert seen.count(f"bent_force_k and {EFFECT} are in the model\n") == 1
    result = read_result(tmp_path / "run")
    assert result.names[-2:] == (EFFECT, "bent_force_k")
    # The diagnosis at the end is of the same model.
    assert result.origin.effect_files == (str(own),)
    assert f"<code>{own}</code>" in (tmp_path / "run" / "report.html").read_text()
    assert "not in what was diagnosed" not in done


def test_watch_that_began_first_waits_for_the_run(tmp_path: Path, apart: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONUNBUFFERED", "1")
    run, watch = None, sdimu("watch")
    try:
        assert watch.stdout is not None
        assert watch.stdout.readline().startswith("no sdimu run on this machine yet: waiting for one")
        run = start_run(tmp_path, apart, 20.0)
        both_ended(run, watch, tmp_path / "run")
    finally:
        for process in (run, watch):
            if process is not None:
                process.kill()
