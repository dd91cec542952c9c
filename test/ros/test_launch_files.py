"""Launch files: executed with a stand-in of launch's API, they name what exists, and the nodes take what they pass."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from sdimu_calibration.storage.files.result_file import read_result

from .conftest import FitSession, write_plan
from .launch_stub import DeclareLaunchArgument, Node, description, started

ROOT = Path(__file__).resolve().parents[2]
FILES = sorted(ROOT.glob("src/*/launch/*_launch.py"))
WAYS = {
    "simulation_launch.py": ({}, {"drive": "plan", "allow_motion": "true"}, {"drive": "adaptive"}),
    "driver_launch.py": ({}, {"table": "ideal"}, {"table": "ideal", "drive": "adaptive", "ask": "false"}),
    "replay_launch.py": ({"bag": "somewhere"},),
}
CASES = [(file, given) for file in FILES for given in WAYS[file.name]]


def executables() -> dict[tuple[str, str], str]:
    """Module of every executable, by package and name."""
    found = {}
    for setup in ROOT.glob("src/*/setup.py"):
        for name, package, program in re.findall(r'"(\w+) = ([\w.]+)\.nodes\.programs:(\w+)"', setup.read_text()):
            text = (setup.parent / package / "nodes/programs.py").read_text()
            loaded = re.search(rf'^{program} = partial\(run_node_program, "([\w.]+)"\)', text, re.MULTILINE)
            assert loaded is not None, name
            found[setup.parent.name, name] = loaded[1]
    return found


@pytest.mark.parametrize(("file", "given"), CASES, ids=lambda case: getattr(case, "name", None) or str(case))
def test_every_node_of_a_launch_file_exists_and_declares_the_parameters_it_is_given(file, given):
    modules = executables()
    for node, _ in started(file, given):
        module = modules[node.package, node.executable].replace(".", "/")
        text = (ROOT / "src" / module.split("/")[0] / f"{module}.py").read_text()
        shared = (ROOT / "src/sdimu_calibration/sdimu_calibration/nodes").glob("*r*.py")  # opening, frames, driver
        declared = text + "".join(path.read_text() for path in shared)
        for parameters in node.parameters:
            unknown = {name for name in parameters if f'"{name}"' not in declared}
            assert not unknown - {"imu_topic", "status_topic", "temperature_topic"}, (node.executable, unknown)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_every_argument_of_a_launch_file_is_described_and_used(file):
    arguments = [e for e in description(file).entities if isinstance(e, DeclareLaunchArgument)]
    text = file.read_text()
    for argument in arguments:
        assert argument.description
        assert len(re.findall(rf'"{argument.name}"', text)) > 1, argument.name


def test_a_namespace_goes_to_every_node():
    for file, given in CASES:
        for node, words in started(file, given | {"namespace": "left"}):
            assert isinstance(node, Node)
            assert "__ns:=/left" in words


@pytest.mark.ros
def test_the_simulation_of_the_launch_file_runs_twice_at_once_in_two_namespaces(bench: FitSession) -> None:
    """Two tables, two IMUs and two calibrations in one graph: each takes its own samples alone."""
    write_plan(bench.plan, 8.0)
    (file,) = (file for file in FILES if file.name == "simulation_launch.py")
    modules = executables()
    for side, seed in (("left", "3"), ("right", "4")):
        out = bench.folder / side
        out.mkdir()
        given = {"namespace": side, "plan": str(bench.plan), "out": str(out), "seed": seed}
        for node, words in started(file, given):
            bench.children.run(f"{side}_{node.name}", modules[node.package, node.executable], words)
    bench.wait_for_end()
    left, right = (read_result(bench.folder / side) for side in ("left", "right"))
    assert left.data["samples"] == right.data["samples"] == 3000
    assert left.data["lost"] == right.data["lost"] == 0
    assert (left.values != right.values).any()
