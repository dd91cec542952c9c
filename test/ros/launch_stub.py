"""Stands in for ros2/launch and launch_ros, which are among no wheels: as much of their API as the launch files use.

Names, arguments and meaning are those of the packages in Jazzy; what they do beyond that is not here, so a launch file
that passes has been executed, but not by `ros2 launch` itself.

    python launch_stub.py INSTALL PACKAGE FILE [NAME:=VALUE ...]     # what colcon has installed, run to its end
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import time
import types
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

Context = Mapping[str, str]


def performed(value: Any, context: Context) -> str:
    """Text of a substitution, of a list of them, or of plain text."""
    if isinstance(value, Sequence) and not isinstance(value, str):
        return "".join(performed(part, context) for part in value)
    return str(value.perform(context)) if hasattr(value, "perform") else str(value)


@dataclass
class LaunchConfiguration:
    variable_name: str

    def perform(self, context: Context) -> str:
        return context[self.variable_name]


@dataclass
class PathJoinSubstitution:
    substitutions: Sequence[Any]

    def perform(self, context: Context) -> str:
        return str(Path(*(performed(part, context) for part in self.substitutions)))


@dataclass
class PythonExpression:
    expression: Sequence[Any]

    def perform(self, context: Context) -> str:
        return str(eval(performed(self.expression, context), {}))


@dataclass
class IfCondition:
    predicate: Any

    def evaluate(self, context: Context) -> bool:
        text = performed(self.predicate, context).strip().lower()
        assert text in ("true", "false", "1", "0"), f"launch takes no '{text}' for a condition"
        return text in ("true", "1")


@dataclass
class ParameterValue:
    value: Any
    value_type: type = field(kw_only=True)

    def evaluate(self, context: Context) -> Any:
        text = performed(self.value, context)
        if self.value_type is bool:
            assert text.lower() in ("true", "false"), text
            return text.lower() == "true"
        return self.value_type(text)


@dataclass
class DeclareLaunchArgument:
    name: str
    default_value: str | None = field(default=None, kw_only=True)
    description: str = field(kw_only=True)


@dataclass
class RegisterEventHandler:
    event_handler: Any


@dataclass(kw_only=True)
class OnProcessExit:
    on_exit: Any


@dataclass(kw_only=True)
class Shutdown:
    reason: str


@dataclass(kw_only=True)
class Node:
    package: str
    executable: str
    name: str
    namespace: Any = ""
    parameters: Sequence[Mapping[str, Any]] = ()
    remappings: Sequence[tuple[Any, Any]] = ()
    output: str = "log"
    condition: IfCondition | None = None

    def command(self, context: Context) -> list[str]:
        """Arguments of the process, with its parameters in a file as launch_ros writes it."""
        values: dict[str, Any] = {}
        for given in self.parameters:
            for key, value in given.items():
                plain = isinstance(value, bool | int | float | list | str)
                typed = value.evaluate(context) if isinstance(value, ParameterValue) else performed(value, context)
                values[key] = value if plain else typed
        file = Path(tempfile.mkdtemp()) / "parameters.yaml"
        file.write_text(yaml.safe_dump({"/**": {"ros__parameters": values}}))
        words = ["--ros-args", "-r", f"__node:={self.name}", "--params-file", str(file)]
        if namespace := performed(self.namespace, context):
            words += ["-r", f"__ns:=/{namespace.strip('/')}"]
        for source, target in self.remappings:
            words += ["-r", f"{performed(source, context)}:={performed(target, context)}"]
        return words


@dataclass
class LaunchDescription:
    entities: Sequence[Any]


@contextmanager
def modules() -> Iterator[None]:
    """Put the stand-ins where launch files import from."""
    made = {
        "launch": {"LaunchDescription": LaunchDescription},
        "launch.actions": {
            "DeclareLaunchArgument": DeclareLaunchArgument,
            "RegisterEventHandler": RegisterEventHandler,
            "Shutdown": Shutdown,
        },
        "launch.event_handlers": {"OnProcessExit": OnProcessExit},
        "launch.conditions": {"IfCondition": IfCondition},
        "launch.substitutions": {
            "LaunchConfiguration": LaunchConfiguration,
            "PathJoinSubstitution": PathJoinSubstitution,
            "PythonExpression": PythonExpression,
        },
        "launch_ros": {},
        "launch_ros.actions": {"Node": Node},
        "launch_ros.parameter_descriptions": {"ParameterValue": ParameterValue},
    }
    for name, content in made.items():
        sys.modules[name] = types.ModuleType(name)
        vars(sys.modules[name]).update(content)
    try:
        yield
    finally:
        for name in made:
            del sys.modules[name]


def description(file: Path) -> LaunchDescription:
    """Execute a launch file."""
    scope: dict[str, Any] = {}
    with modules():
        exec(compile(file.read_text(), str(file), "exec"), scope)
        made = scope["generate_launch_description"]()
    assert isinstance(made, LaunchDescription)
    return made


def started(file: Path, given: Context) -> list[tuple[Node, list[str]]]:
    """Nodes that a launch file starts with these arguments, and the arguments of their processes."""
    entities = description(file).entities
    arguments = [entity for entity in entities if isinstance(entity, DeclareLaunchArgument)]
    unknown = set(given) - {argument.name for argument in arguments}
    assert not unknown, f"{file.name} has no argument {unknown}"
    context = {a.name: given.get(a.name, a.default_value) for a in arguments}
    missing = [name for name, value in context.items() if value is None]
    assert not missing, f"{file.name} needs {missing}"
    nodes = [entity for entity in entities if isinstance(entity, Node)]
    chosen = [node for node in nodes if node.condition is None or node.condition.evaluate(context)]
    return [(node, node.command(context)) for node in chosen]


def watched(processes: Sequence[subprocess.Popen[bytes]], deadline_s: float = 500.0) -> int:
    """Wait until all processes have ended or one has failed; the status."""
    begun = time.monotonic()
    while time.monotonic() - begun < deadline_s:
        codes = [process.poll() for process in processes]
        if any(codes):
            return max(abs(code) for code in codes if code)
        if all(code == 0 for code in codes):
            return 0
        time.sleep(0.1)
    left = [str(process.args) for process in processes if process.poll() is None]
    sys.stderr.write(f"not done after {deadline_s:g} s: {left}\n")
    return 1


def main() -> int:
    """Run a launch file from an install tree of colcon, and nothing else on the paths."""
    install, package, name, *rest = sys.argv[1:]
    prefix = Path(install).resolve()
    given = dict(re.fullmatch(r"(\w+):=(.*)", text).groups() for text in rest)
    (python,) = {path.parent.name for path in prefix.glob("*/lib/python3*/site-packages")}
    paths = [str(path) for path in sorted(prefix.glob(f"*/lib/{python}/site-packages"))]
    environment = os.environ | {"PYTHONPATH": ":".join(paths)}
    environment.pop("SDIMU_CONFIG", None)
    ask = "import sdimu_calibration.storage.files.config as c; print(c.config_folder())"
    told = subprocess.run(
        [sys.executable, "-c", ask], env=environment, cwd="/", capture_output=True, text=True, check=True
    )
    assert Path(told.stdout.strip()).is_relative_to(prefix), f"configuration of {told.stdout} instead of {prefix}"
    file = prefix / package / "share" / package / "launch" / name
    with tempfile.TemporaryDirectory() as folder:
        processes = [
            subprocess.Popen(
                [str(prefix / node.package / "lib" / node.package / node.executable), *words],
                env=environment,
                cwd=folder,
            )
            for node, words in started(file, given)
        ]
        try:
            return watched(processes)
        finally:
            for process in processes:
                process.kill()


if __name__ == "__main__":
    sys.exit(main())
