"""The house itself: borders, configuration, and what must not be in it."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from sdimu_calibration.storage.config import load_imu, load_model, load_plan, load_site
from sdimu_calibration.storage.reference_file import read_reference

ROOT = Path(__file__).resolve().parents[1]
LOADERS = {"plan": load_plan, "imu": load_imu, "model": load_model, "site": load_site, "reference": read_reference}
CONFIG_FILES = sorted((ROOT / "config").rglob("*.yaml"))


def tracked_files() -> list[Path]:
    done = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip("not a git checkout")
    return [ROOT / name for name in done.stdout.split("\0") if name and (ROOT / name).is_file()]


def test_imports_point_one_way():
    command = Path(sys.executable).with_name("lint-imports")
    done = subprocess.run([command, "--no-cache"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("path", CONFIG_FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_configuration_file_loads_by_its_name(path):
    kind = path.parent.name
    if kind in LOADERS:
        assert LOADERS[kind](path.stem) == LOADERS[kind](path)
    else:
        assert yaml.safe_load(path.read_text())


def test_no_file_names_a_host_of_packages():
    # A lock file or a document that names a host breaks wherever that host is not reachable.
    host = re.compile(r"--(extra-)?index-url|--find-links|--trusted-host|pypi\.|files\.pythonhosted|https?://\S*/simple\b")
    guilty = [
        f"{path.relative_to(ROOT)}: {match.group()}"
        for path in tracked_files()
        if path != Path(__file__).resolve()
        if (match := host.search(path.read_text(encoding="utf-8", errors="ignore")))
    ]
    assert guilty == []


def test_no_file_names_a_place_on_one_machine():
    home = re.compile(r"(?<![\w.])/(home|root|Users|work)/\w+")
    guilty = [
        f"{path.relative_to(ROOT)}: {match.group()}"
        for path in tracked_files()
        if path != Path(__file__).resolve()
        if (match := home.search(path.read_text(encoding="utf-8", errors="ignore")))
    ]
    assert guilty == []


def test_files_stay_short_enough_to_read():
    long = {
        str(path.relative_to(ROOT)): count
        for path in tracked_files()
        if path.suffix == ".py"
        if (count := path.read_text().count("\n")) > 450
    }
    assert long == {}


def test_every_package_declares_itself_as_ament_python():
    for manifest in ROOT.glob("src/*/package.xml"):
        assert "<build_type>ament_python</build_type>" in manifest.read_text()
        assert (manifest.parent / "resource" / manifest.parent.name).is_file()
