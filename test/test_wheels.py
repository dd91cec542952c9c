"""The three wheels: what is in them is all that `pip install` brings to a machine without a clone; and the studies'."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import sys
import zipfile
from email.parser import Parser
from importlib.metadata import PackageNotFoundError, packages_distributions, requires
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("rate_table_sim", "sdimu_calibration", "sdimu_sim")
STUDY = "sdimu_study"
SOURCES = {name: Path("src") / name for name in PACKAGES} | {STUDY: Path("study")}
OPTIONAL = {
    "matio",
    "h5py",
    "tf2_msgs",
    "dash",
    "flask",
    "werkzeug",
    "plotly",
    "pandas",
    "matplotlib",
    "PIL",
    "dask",
    "distributed",
}
"""Imported where it is installed; nodes/transform_type stands in for the first, extras and `sdimu_study` bring the
others, and whoever lacks them is told so."""


@pytest.fixture(scope="module")
def wheels(tmp_path_factory):
    """Archive of each wheel, by name of the package; built from a copy, so that no build folder is left."""
    folder = tmp_path_factory.mktemp("wheels")
    leftovers = shutil.ignore_patterns("build", "*.egg-info", "__pycache__")
    for part in ("config", "src", "study"):
        shutil.copytree(ROOT / part, folder / part, ignore=leftovers)
    shutil.copy(ROOT / "LICENSE", folder)
    options = ["--no-deps", "--no-build-isolation", "--no-index", "--disable-pip-version-check", "-q"]
    sources = [str(folder / source) for source in SOURCES.values()]
    done = subprocess.run(
        [sys.executable, "-m", "pip", "wheel", *options, "-w", str(folder), *sources],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return {path.name.split("-")[0]: zipfile.ZipFile(path) for path in folder.glob("*.whl")}


def metadata(wheel):
    name = next(name for name in wheel.namelist() if name.endswith(".dist-info/METADATA"))
    return Parser().parsestr(wheel.read(name).decode())


def requirements(wheel):
    found = [Requirement(text) for text in metadata(wheel).get_all("Requires-Dist", [])]
    return [r for r in found if r.marker is None or r.marker.evaluate({"extra": ""})]


def test_all_configuration_files_are_in_the_wheel(wheels):
    names = wheels["sdimu_calibration"].namelist()
    inside = {name for name in names if name.startswith("sdimu_calibration/config/")}
    shipped = {path for path in (ROOT / "config").rglob("*") if path.is_file()}
    assert inside == {f"sdimu_calibration/config/{path.relative_to(ROOT / 'config').as_posix()}" for path in shipped}
    for path in shipped:
        name = f"sdimu_calibration/config/{path.relative_to(ROOT / 'config').as_posix()}"
        assert wheels["sdimu_calibration"].read(name) == path.read_bytes()
        # And once more where users of ROS look for it.
        (shared,) = (n for n in names if n.endswith(f"/share/{name}"))
        assert wheels["sdimu_calibration"].read(shared) == path.read_bytes()


def test_launch_files_are_in_the_share_folders_of_the_wheels(wheels):
    for file in ROOT.glob("src/*/launch/*_launch.py"):
        package = file.parents[1].name
        (name,) = (n for n in wheels[package].namelist() if n.endswith(f"share/{package}/launch/{file.name}"))
        assert wheels[package].read(name) == file.read_bytes()


@pytest.mark.parametrize("package", SOURCES)
def test_every_module_type_marker_and_licence_is_in_the_wheel(wheels, package):
    inside = wheels[package].namelist()
    source = ROOT / SOURCES[package]
    modules = {path.relative_to(source).as_posix() for path in (source / package).rglob("*.py")}
    assert modules == {name for name in inside if name.endswith(".py") and name.startswith(f"{package}/")}
    assert f"{package}/py.typed" in inside
    licence = next(name for name in inside if name.endswith("LICENSE"))
    assert wheels[package].read(licence) == (ROOT / "LICENSE").read_bytes()


def test_every_entry_point_names_something_that_exists(wheels):
    points = []
    for wheel in wheels.values():
        name = next(name for name in wheel.namelist() if name.endswith("/entry_points.txt"))
        points += re.findall(r"^(\S+) = ([\w.]+):(\w+)$", wheel.read(name).decode(), re.MULTILINE)
    names = {name for name, _, _ in points}
    assert {"sdimu", "simulate", "run", "calibration_node", "rate_table_node", "sdimu_node"} <= names
    for _, module, attribute in points:
        path = f"{module.replace('.', '/')}.py"
        text = wheels[module.split(".")[0]].read(path).decode()
        assert re.search(rf"^(def {attribute}\(|{attribute} = )", text, re.MULTILINE), (module, attribute)


@pytest.mark.parametrize("package", PACKAGES)
def test_version_and_licence_are_those_of_the_manifest(wheels, package):
    manifest = (ROOT / "src" / package / "package.xml").read_text()
    for field, element in (("Version", "version"), ("License", "license"), ("Summary", "description")):
        assert f"<{element}>{metadata(wheels[package])[field]}</{element}>" in manifest


def test_studies_are_in_a_wheel_of_their_own_with_the_heads_of_their_pages(wheels):
    heads = {f"{STUDY}/heads/{path.name}" for path in (ROOT / "study" / STUDY / "heads").glob("*.md")}
    assert heads <= set(wheels[STUDY].namelist())
    for package in PACKAGES:
        points = [name for name in wheels[package].namelist() if name.endswith("/entry_points.txt")]
        assert not any("campaign" in name or STUDY in name for name in wheels[package].namelist())
        assert not any(STUDY in wheels[package].read(name).decode() for name in points)


def test_the_simulator_brings_all_three(wheels):
    version = {name: metadata(wheel)["Version"] for name, wheel in wheels.items()}
    wanted = {canonicalize_name(r.name): str(r.specifier) for r in requirements(wheels["sdimu_sim"])}
    for other in ("rate_table_sim", "sdimu_calibration"):
        assert wanted[canonicalize_name(other)] == f"=={version[other]}"


@pytest.mark.parametrize("package", SOURCES)
def test_whatever_is_imported_is_required(wheels, package):
    available = closure(requirements(wheels[package]), wheels)
    owners = packages_distributions()
    lacking = {
        module
        for module in imported(ROOT / SOURCES[package] / package) - set(sys.stdlib_module_names) - OPTIONAL - {package}
        if not {canonicalize_name(name) for name in owners.get(module, ())} & available
    }
    assert lacking == set()


def imported(folder):
    """Top-level names of all modules that the source imports, inside functions too."""
    names = set()
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                names |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                names.add(node.module.split(".")[0])
    return names


def closure(wanted, wheels):
    """Names of all distributions that these requirements bring."""
    found, waiting = set(), list(wanted)
    while waiting:
        one = waiting.pop()
        name, extras = canonicalize_name(one.name), one.extras or {""}
        if (name, *sorted(extras)) in found:
            continue
        found.add((name, *sorted(extras)))
        own = next((wheel for key, wheel in wheels.items() if canonicalize_name(key) == name), None)
        try:
            lines = [str(r) for r in requirements(own)] if own else requires(name) or []
        except PackageNotFoundError:
            continue
        for text in lines:
            r = Requirement(text)
            if r.marker is None or any(r.marker.evaluate({"extra": extra}) for extra in extras):
                waiting.append(r)
    return {name for name, *_ in found}
