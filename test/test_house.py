"""The house itself: borders, configuration, and what must not be in it."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest
import yaml

import sdimu_calibration.core.effects  # noqa: F401  (fills the registry)
from sdimu_calibration.core.effects import registry
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan, load_site
from sdimu_calibration.storage.files.reference_file import read_reference

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
    host = re.compile(
        r"--(extra-)?index-url|--find-links|--trusted-host|pypi\.|files\.pythonhosted|https?://\S*/simple\b"
    )
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
        if (count := path.read_text().count("\n")) > 480  # as the formatter writes them, an argument a line
    }
    assert long == {}


def test_every_package_declares_itself_as_ament_python():
    for manifest in ROOT.glob("src/*/package.xml"):
        assert "<build_type>ament_python</build_type>" in manifest.read_text()
        assert (manifest.parent / "resource" / manifest.parent.name).is_file()


@pytest.mark.parametrize("manifest", sorted(ROOT.glob("src/*/package.xml")), ids=lambda path: path.parent.name)
def test_a_manifest_names_every_ros_package_that_is_imported(manifest):
    ros = re.compile(r"^\s*(?:from|import) (rclpy|launch|launch_ros|\w+_(?:msgs|srvs|interfaces))\b", re.MULTILINE)
    texts = [path.read_text() for path in manifest.parent.rglob("*.py") if "build" not in path.parts]
    imported = {name for text in texts for name in ros.findall(text)}
    assert imported <= set(re.findall(r"<exec_depend>(\w+)</exec_depend>", manifest.read_text()))


_NAMED_IN = ("core/effects/", "core/site_reference.py", "core/hidden.py", "core/truth.py", "core/true_coefficients.py")
"""Where effects have their names: the registry, what a site file may state of them, and the truth of the simulator."""
_OTHER_WORDS = {"temperature_rate", "random_walk"}
"""A field of `Motion`, and a term of the Allan deviation."""


@cache
def effect_names() -> frozenset[str]:
    effects = [registry.get(name) for name in registry.names()]
    return frozenset({e.name for e in effects} | {p.name for e in effects for p in e.parameters})


def effect_names_in(tree: ast.AST) -> list[tuple[int, str]]:
    """Line and text of every literal that is the name of an effect or coefficient, a part of one, or makes one.

    Sentences may name effects; a word alone, or a pattern such as ``f"{triad}_misalignment_{pair}"``, is a list of
    effects kept where a new one does not find it.
    """
    names = effect_names()
    lines = "\n".join(names)
    prose = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    inner = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            parts = [part.value if isinstance(part, ast.Constant) else None for part in node.values]
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and not {id(node)} & (prose | inner):
            parts = [node.value]
        else:
            continue
        fixed = "".join(part or "" for part in parts)
        if "_" not in fixed.strip("_") and fixed.strip("_") not in names and None not in parts:
            continue
        if fixed in _OTHER_WORDS or not re.fullmatch(r"[a-z0-9_]{5,}", fixed):
            continue
        pattern = "".join(r"\w+" if part is None else re.escape(part) for part in parts)
        if re.search(rf"(^|_){pattern.strip('_')}(_|$)", lines, re.MULTILINE):
            found.append((node.lineno, ast.unparse(node)))
    return found


def test_no_effect_is_named_outside_its_file_and_the_truth_of_the_simulator():
    # A list of effects elsewhere is a trait in the wrong place: a new effect would not be in it (CONTRIBUTING.md).
    guilty = [
        f"{path.relative_to(ROOT)}:{line}: {text}"
        for path in sorted((ROOT / "src").rglob("*.py"))
        if not any(part in path.as_posix() for part in _NAMED_IN)
        for line, text in effect_names_in(ast.parse(path.read_text()))
    ]
    assert guilty == []


@pytest.mark.parametrize(
    "code",
    [
        'x = "gyro_bias"',
        'x = ("accel_quadratic_x", 3)',
        'x = prior.get("accel_misalignment")',
        'x = f"gyro_bias_{axis}"',
        'x = f"{triad}_misalignment_{pair}"',
        'x = name.endswith("bias_warm_up")',
        'x = name.startswith("gyro_g_sensitivity_")',
    ],
)
def test_a_name_of_an_effect_is_noticed(code):
    assert len(effect_names_in(ast.parse(code))) == 1


@pytest.mark.parametrize(
    "code",
    [
        '"""gyro_bias"""',
        'x = "the gyro_bias is large"',
        'x = f"{stem}_{axis}"',
        'x = "gyro_white_noise"',
        'x = "accel"',
    ],
)
def test_what_names_no_effect_is_left_alone(code):
    assert effect_names_in(ast.parse(code)) == []
