"""What README and tutorials tell a reader to type, typed."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from .pages import ROOT, Block, commands, fenced, run
from .warm import warm_program

# Under a load of eight the longest page took six minutes.
pytestmark = pytest.mark.timeout(1800)

TUTORIALS = sorted((ROOT / "doc" / "tutorials").glob("*.md"))
LIVE = "live"
DOWNLOADED = {"public-recording": ("nilspod/ferraris_session.csv", "example_ferraris_session.csv")}
"""What the reader of a tutorial downloads: where it lies among the recordings, and its name on the page."""
STAYS = ("sdimu workbench", "sdimu watch")
"""Run until they are stopped: the tests in a browser and those of the live diagnosis hold them."""
COLD = (LIVE, "first-calibration")
"""Pages whose commands start from nothing: one stops programs by signals, the other is the first that is read."""


@pytest.mark.parametrize(
    "page",
    [pytest.param(p, marks=pytest.mark.ros if p.stem == LIVE else ()) for p in TUTORIALS],
    ids=lambda page: page.stem,
)
def test_a_tutorial_runs_as_it_stands(page, tmp_path, recorded):
    blocks = fenced(page)
    assert blocks
    if page.stem in DOWNLOADED:
        name, here = DOWNLOADED[page.stem]
        shutil.copyfile(recorded(name), tmp_path / here)
    run(blocks, tmp_path, warm=page.stem not in COLD)


@pytest.mark.parametrize("line", ["--version", "bag info nothing", "calibrate", "noverb", "effects gyro_scale"])
def test_a_command_without_its_start_does_what_the_program_does(tmp_path, line):
    with warm_program(tmp_path) as words:
        warm, cold = (
            subprocess.run(
                [*program, *line.split()],
                cwd=tmp_path,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                check=False,
            )
            for program in (words, [Path(sys.executable).with_name("sdimu")])
        )
    assert warm.stdout + warm.stderr
    assert (warm.returncode, warm.stdout, warm.stderr) == (cold.returncode, cold.stdout, cold.stderr)


def test_the_commands_of_the_readme_run_as_they_stand(tmp_path, batch):
    lines = commands(ROOT / "README.md")
    assert len(lines) > 10
    # What is the reader's own: a recording, its place and data sheet, results of many units.
    (tmp_path / "FOLDER").symlink_to(batch())
    (tmp_path / "BAG").symlink_to("out/bag")
    for kind, name, own in (("site", "daejeon", "my_site"), ("imu", "dtg", "my_imu")):
        shutil.copy(ROOT / "config" / kind / f"{name}.yaml", tmp_path / f"{own}.yaml")
    run([Block("bash", line) for line in lines if not line.startswith(STAYS)], tmp_path, warm=True)
