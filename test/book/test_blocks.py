"""What README and tutorials tell a reader to type, typed."""

from __future__ import annotations

import shutil

import pytest

from .pages import ROOT, Block, Processes, commands, fenced, run

# Under a load of eight the longest page took six minutes.
pytestmark = pytest.mark.timeout(1800)

TUTORIALS = sorted((ROOT / "doc" / "tutorials").glob("*.md"))
LIVE = "live"
STARTED = {"first-calibration", LIVE}
"""Tutorials whose every command starts a process, as a reader's shell does. The others' are forked from one that has
loaded everything: to load it took more than half of their time."""
DOWNLOADED = {"public-recording": ("nilspod/ferraris_session.csv", "example_ferraris_session.csv")}
"""What the reader of a tutorial downloads: where it lies among the recordings, and its name on the page."""
LEFT = ("sdimu workbench", "sdimu watch", "sdimu run")
"""What runs until it is stopped, and a test over DDS that chooses its turns: held by the tests in a browser, by those
of the live diagnosis and by ros/test_adaptive.py. Here the command line takes what the page says and shows its help."""
SMALLER = {"sdimu simulate ": "sdimu simulate --rate 20 ", "sdimu plan": "sdimu plan --tries 2"}
"""Commands that do the same with less: a fifth of the samples, few of the plans that are tried."""


@pytest.mark.parametrize(
    "page",
    [pytest.param(p, marks=pytest.mark.ros if p.stem == LIVE else ()) for p in TUTORIALS],
    ids=lambda page: page.stem,
)
def test_a_tutorial_runs_as_it_stands(page, tmp_path, recorded, request):
    blocks = fenced(page)
    assert blocks
    if page.stem in DOWNLOADED:
        name, here = DOWNLOADED[page.stem]
        shutil.copyfile(recorded(name), tmp_path / here)
    run(blocks, tmp_path, Processes() if page.stem in STARTED else request.getfixturevalue("fork"))


def test_the_commands_of_the_readme_run(tmp_path, batch, fork):
    lines = commands(ROOT / "README.md")
    assert len(lines) > 10
    # What is the reader's own: a recording, its place and data sheet, results of many units.
    (tmp_path / "FOLDER").symlink_to(batch())
    (tmp_path / "BAG").symlink_to("out/bag")
    for kind, name, own in (("site", "daejeon", "my_site"), ("imu", "dtg", "my_imu")):
        shutil.copy(ROOT / "config" / kind / f"{name}.yaml", tmp_path / f"{own}.yaml")
    assert all(any(line.startswith(begin) for line in lines) for begin in (*LEFT, *SMALLER))
    for begin, less in SMALLER.items():
        lines = [line.replace(begin, less, 1) if line.startswith(begin) else line for line in lines]
    lines = [f"{line} --help" if line.startswith(LEFT) else line for line in lines]
    run([Block("bash", line) for line in lines], tmp_path, fork)


@pytest.mark.parametrize(
    ("language", "text", "said"),
    [
        ("bash", "sdimu compare nothing nowhere", "sdimu: nothing: "),
        ("bash", "sdimu simulate --no-such-option", "No such option"),
        ("bash", "false", "false"),
        ("python", "import sys\n\nsys.exit('it is wrong')", "it is wrong"),
        ("python", "assert 1 == 2", "AssertionError"),
    ],
)
def test_what_fails_in_a_fork_fails_its_page(tmp_path, fork, language, text, said):
    with pytest.raises(AssertionError, match=said):
        run([Block(language, text)], tmp_path, fork)


def test_a_fork_has_folder_streams_and_environment_of_its_own(tmp_path, fork):
    blocks = [
        Block("bash", "COLUMNS=200 sdimu --version > version.txt; COLUMNS=200 sdimu effects > effects.txt"),
        Block("python", "import os\n\nprint(os.getcwd(), __name__, len(open('version.txt').read().split()))"),
        Block("python", "print(max(map(len, open('effects.txt').read().splitlines())) > 100)"),
    ]
    assert run(blocks, tmp_path, fork).split() == [str(tmp_path), "__main__", "2", "True"]
