"""What README and tutorials tell a reader to type, typed."""

from __future__ import annotations

import shutil

import pytest

from .pages import ROOT, Block, commands, fenced, run

# Under a load of eight the longest page took six minutes.
pytestmark = pytest.mark.timeout(1800)

TUTORIALS = sorted((ROOT / "doc" / "tutorials").glob("*.md"))
LIVE = "live"
DOWNLOADED = {"public-recording": ("nilspod/ferraris_session.csv", "example_ferraris_session.csv")}
"""What the reader of a tutorial downloads: where it lies among the recordings, and its name on the page."""
STAYS = ("sdimu workbench", "sdimu watch")
"""Run until they are stopped: the tests in a browser and those of the live diagnosis hold them."""


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
    run(blocks, tmp_path)


def test_the_commands_of_the_readme_run_as_they_stand(tmp_path, batch):
    lines = commands(ROOT / "README.md")
    assert len(lines) > 10
    # What is the reader's own: a recording, its place and data sheet, results of many units.
    (tmp_path / "FOLDER").symlink_to(batch())
    (tmp_path / "BAG").symlink_to("out/bag")
    for kind, name, own in (("site", "daejeon", "my_site"), ("imu", "dtg", "my_imu")):
        shutil.copy(ROOT / "config" / kind / f"{name}.yaml", tmp_path / f"{own}.yaml")
    run([Block("bash", line) for line in lines if not line.startswith(STAYS)], tmp_path)
