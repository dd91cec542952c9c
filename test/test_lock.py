"""The lock files: every file by its hash, every package once, all that setup.py asks for."""

from __future__ import annotations

import re
import runpy
import subprocess
import sys
from importlib.metadata import requires
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
FILES = ("run", "extras", "campaigns", "test", "build", "docs")
EXTRAS = {
    "run": ("",),
    "extras": ("workbench", "notebook", "pictures", "matlab"),
    "campaigns": ("study",),
    "test": ("test",),
    "build": ("build",),
    "docs": ("docs",),
}
OWN = ("sdimu-calibration", "rate-table-sim", "sdimu-sim", "sdimu-study")
STUDY = OWN[-1]
"""Not installed by users: what it needs alone is in the file of campaigns."""

ENTRY = re.compile(r'[a-z0-9-]+==[\w.+!]+( ; python_version != "3\.\d+")?( +--hash=sha256:[0-9a-f]{64})+')


def entries(name: str) -> list[str]:
    """Each requirement with its hashes, in one line."""
    text = (ROOT / "requirements" / f"{name}.lock").read_text(encoding="utf-8").replace("\\\n", " ")
    return [line for line in text.splitlines() if line and not line.startswith("#")]


@pytest.mark.parametrize("name", FILES)
def test_every_package_is_pinned_with_hashes(name):
    for entry in entries(name):
        assert ENTRY.fullmatch(entry)


def test_no_package_is_in_two_files():
    names = [entry.partition("==")[0] for name in FILES for entry in entries(name)]
    assert len(names) == len(set(names))


@pytest.mark.parametrize("name", FILES)
def test_what_setup_asks_for_is_in_its_file_or_in_what_is_installed_before(name):
    there = {entry.partition("==")[0] for file in FILES[: FILES.index(name) + 1] for entry in entries(file)}
    for package in OWN:
        always = name == ("campaigns" if package == STUDY else "run")
        for text in requires(package) or []:
            one = Requirement(text)
            extra = one.marker is not None and any(one.marker.evaluate({"extra": extra}) for extra in EXTRAS[name])
            if (one.marker is None) if always else extra:
                assert canonicalize_name(one.name) in {*there, *OWN}, one


def test_loops_are_compiled_before_ros_is_there():
    """requirements/install.py fetches the packages of ROS beside the others, and compiles when these are there."""
    script = ROOT / "requirements" / "kernels.py"
    code = f"""
import runpy, sys
kernels = runpy.run_path({str(script)!r})
from sdimu_calibration.core.evidence import signatures
from sdimu_calibration.core.filter import filter_pass, kalman
from sdimu_calibration.storage.files import journal_walk
loops = [signatures._signatures, signatures._constant_signatures, journal_walk._walk]
loops += [filter_pass._measurement, filter_pass._feed_back, filter_pass._write, kalman.update]
loops.append(kernels["strapdown"]._navigate)
kernels["parts_of_the_pass"]()
kernels["without_a_pass"]()
called = [len(loop.signatures) for loop in loops]
kernels["other_loops"]()
print("rclpy" in sys.modules, called, [len(loop.signatures) for loop in loops])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    # What is called with zeros is what a fit and a diagnosis call: the same types.
    assert done.stdout.strip() == f"False {[1] * 8} {[1] * 8}", done.stderr
    first = {
        entry.partition("==")[0] for entry in entries("run") if not entry.startswith("ros-") and " ; " not in entry
    }
    assert {"numba", "numpy", "scipy", "pydantic", "pyyaml"} <= first
    for name in sorted(first):
        assert not [text for text in requires(name) or [] if text.startswith("ros-")], name


def test_loops_that_are_not_compiled_ahead_are_told_and_break_no_installation(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    (tmp_path / "kernels.py").write_text("raise ImportError('no numba here')")
    script = runpy.run_path(str(ROOT / "requirements" / "install.py"))
    monkeypatch.setitem(script["Loops"].start.__globals__, "FOLDER", tmp_path)
    loops = script["Loops"]()
    loops.start()
    for process in loops._parts.values():
        process.wait(60)
    loops.tell()
    told = capsys.readouterr().out.splitlines()
    assert len(told) == 2
    for line, part in zip(told, ("filter", "others"), strict=True):
        assert "not compiled ahead (ImportError: no numba here" in line
        assert (tmp_path / f".loops-{part}.log").is_file()


TOOLS = {
    "dask",
    "distributed",
    "mypy",
    "ruff",
    "hypothesis",
    "playwright",
    "colcon-core",
    "pandas",
    "mat-io",
    "h5py",
    "pytest",
    "numpydoc",
    "sphinx",
    "babel",
    "docutils",
    "allantools",
    "dash",
    "flask",
    "plotly",
    "matplotlib",
    "pillow",
}
"""Packages for tests, the book, campaigns, the workbench, notebooks and pictures."""


def test_what_runs_brings_no_tools_and_no_extras():
    assert not {entry.partition("==")[0] for entry in entries("run")} & TOOLS


def test_what_stands_in_for_transforms_is_brought():
    # nodes/transform_type opens the libraries of this package, which no import shows.
    assert any(entry.startswith("ros-visualization-msgs==") for entry in entries("run"))
