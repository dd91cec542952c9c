"""doc/on-a-ros-machine.md, tried: built by colcon on the versions that Ubuntu 24.04 has, run by the real `ros2`.

`SDIMU_ROS2` names a folder with the sources of launch, launch_ros, ros2cli and rosidl_runtime_py (branches jazzy),
which are among no wheels; without it the tests of `ros2` are skipped.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest

from sdimu_calibration.cli.processes import own_domain
from sdimu_calibration.storage.files.result_file import read_result

from .conftest import DEADLINE_S, write_plan

ROOT = Path(__file__).resolve().parents[2]
TOOLS = "SDIMU_ROS2"
SYSTEM = ("numpy==1.26.4", "scipy==1.11.4", "PyYAML==6.0.1")
"""What rosdep installs on Ubuntu 24.04; numpy 1.26 has no wheel for Python 3.13 and later."""
QUESTION = "std_msgs/msg/String"
"""Type of the table's question: `ros2 topic echo` then needs not wait until it has found the publisher."""
PAGES = ("README.md", *sorted(str(p.relative_to(ROOT)) for p in (ROOT / "doc").glob("*.md")))


def documented() -> set[str]:
    """The first words of every `ros2` command that a page names: verb, what is called, and its first argument."""
    found = set()
    for page in PAGES:
        text = re.sub(r"\\?\n\s*", " ", (ROOT / page).read_text(encoding="utf-8"))
        for words in re.findall(r"\bros2 ((?:launch|param|topic|service|run) \S+ [^\s`]+)", text):
            found.add(words.replace("PARAMETER", "").rstrip(":"))
    return found


def test_every_command_of_ros2_that_a_page_names_is_run_by_a_test_of_this_file():
    tried = Path(__file__).read_text(encoding="utf-8")
    assert len(documented()) > 10
    assert not [words for words in sorted(documented()) if words not in tried]


def test_what_pip_adds_on_a_ros_machine_is_what_the_system_has_not():
    setup = (ROOT / "src/sdimu_calibration/setup.py").read_text(encoding="utf-8")
    needed = re.findall(r'"(.+?)"', setup.split("RUN_TIME = [")[1].split("\n]")[0])
    by_system = {"PyYAML", "numpy>=1.26", "scipy", "ros-jazzy-common-interfaces", "ros-jazzy-rclpy[fastrtps]"}
    lines = (ROOT / "requirements/ros-machine.txt").read_text(encoding="utf-8").splitlines()
    assert {line for line in lines if line and not line.startswith("#")} == set(needed) - by_system
    assert by_system < set(needed)


def quietly(command: list[str], environment: Mapping[str, str] = os.environ) -> None:
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode == 0, done.stdout + done.stderr


class RosMachine:
    """What `. install/setup.bash` gives on a machine with the system's numpy, and where the tools of ROS are."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.install = folder, folder / "install"
        pip = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--disable-pip-version-check"]
        # Bytecode of the modules that are used is made when they are: a tenth of all.
        quietly([*pip, "--no-compile", "--target", str(folder / "system"), *SYSTEM])
        self.bin = str(Path(sys.executable).parent)
        path = f"{self.bin}:{os.environ['PATH']}"
        built = dict(os.environ) | {"PYTHONPATH": str(folder / "system"), "PATH": path}
        for name in ("log", "build"):
            (folder / name).mkdir()
        bases = {"--build-base": folder / "build", "--install-base": self.install}
        where = [word for name, path in bases.items() for word in (name, str(path))]
        quietly(["colcon", "--log-base", str(folder / "log"), "build", "--base-paths", "src", *where], built)
        sourced = f'. "{self.install}/setup.bash" && env -0'
        told = subprocess.run(["bash", "-c", sourced], env=built, capture_output=True, text=True, check=True)
        self.environment = dict(entry.partition("=")[::2] for entry in told.stdout.split("\0") if entry)
        self.environment["OPENBLAS_NUM_THREADS"] = "1"
        self.environment.pop("ROS_DOMAIN_ID", None)
        self.plan = write_plan(folder / "plan.yaml", 12.0)

    def sdimu(self, *words: object) -> subprocess.CompletedProcess[str]:
        program = self.install / "sdimu_calibration/lib/sdimu_calibration/sdimu"
        done = subprocess.run(
            [str(program), *map(str, words)],
            env=self.environment,
            cwd=self.folder,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return done


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> RosMachine:
    if sys.version_info >= (3, 13):
        pytest.skip("numpy 1.26 has no wheel for this Python")
    return RosMachine(tmp_path_factory.mktemp("ros_machine"))


@pytest.fixture(scope="module")
def bag(machine: RosMachine) -> Path:
    machine.sdimu("simulate", "--plan", machine.plan, "--seed", 3, "--out", machine.folder / "bag")
    return machine.folder / "bag"


@pytest.mark.ros
def test_a_bag_gives_on_the_versions_of_the_system_the_result_that_it_gives_here(machine: RosMachine, bag: Path):
    asked = "import numpy, sdimu_calibration.storage.files.config as c; print(numpy.__version__, c.config_folder())"
    told = subprocess.run(
        [sys.executable, "-c", asked],
        env=machine.environment,
        cwd=machine.folder,
        capture_output=True,
        text=True,
        check=True,
    )
    version, configuration = told.stdout.split()
    assert version == "1.26.4"
    assert Path(configuration).is_relative_to(machine.install)
    there = machine.sdimu("calibrate", bag, "--imu", "dtg", "--site", "daejeon", "--out", machine.folder / "there")
    assert "Warning" not in there.stderr
    here = machine.folder / "here"
    quietly([f"{machine.bin}/sdimu", "calibrate", str(bag), "--imu", "dtg", "--site", "daejeon", "--out", str(here)])
    one, other = read_result(machine.folder / "there"), read_result(here)
    assert one.names == other.names
    # Two libraries of linear algebra differ in the last digits.
    assert np.all(np.abs(one.values - other.values) <= 1e-4 * np.sqrt(np.diag(other.covariance)) + 1e-15)


class Ros2:
    """The command `ros2`, in a domain of its own."""

    def __init__(self, machine: RosMachine, tools: Path, log: Path) -> None:
        here = {k: v for k, v in os.environ.items() if k.startswith(("ROS_", "FASTRTPS"))}
        self.environment = machine.environment | here | {"ROS_LOG_DIR": str(log)}
        self.environment["PYTHONPATH"] = f"{tools}:{machine.environment['PYTHONPATH']}"
        self.program = str(tools / "bin" / "ros2")
        self.folder = log

    def __call__(self, words: str, *more: str, within_s: float = 60.0) -> str:
        """Run a command to its end; what it printed."""
        process = subprocess.Popen(
            [self.program, *words.split(), *more],
            env=self.environment,
            cwd=self.folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        try:
            told, _ = process.communicate(timeout=within_s)
        finally:
            # What it has started ends with it.
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
        assert process.returncode == 0, f"ros2 {words}: {told}"
        return told

    @contextmanager
    def running(self, words: str, *more: str) -> Iterator[subprocess.Popen[bytes]]:
        """Run a command beside the test; ended as by Ctrl-C."""
        name = re.sub(r"\W+", "_", words)[:60]
        with (self.folder / f"{name}.log").open("wb") as log:
            process = subprocess.Popen(
                [self.program, *words.split(), *more],
                env=self.environment,
                cwd=self.folder,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
            try:
                yield process
                if process.poll() is None:
                    os.killpg(process.pid, signal.SIGINT)
                assert process.wait(60.0) == 0, (self.folder / f"{name}.log").read_text(encoding="utf-8")
            finally:
                if process.poll() is None:
                    os.killpg(process.pid, signal.SIGKILL)


@pytest.fixture(scope="module")
def tools(machine: RosMachine) -> Path:
    """The tools of ROS, installed from a copy of their sources: pip writes beside a setup.py."""
    if not (given := os.environ.get(TOOLS)):
        pytest.skip(f"{TOOLS} names no folder with the sources of launch and ros2cli")
    copy, target = machine.folder / "sources", machine.folder / "tools"
    shutil.copytree(given, copy, copy_function=shutil.copyfile)
    folders = [str(file.parent) for file in sorted(copy.rglob("setup.py"))]
    pip = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--disable-pip-version-check"]
    quietly([*pip, "--no-build-isolation", "--target", str(target), *folders, "osrf-pycommon"])
    # No launch file here composes nodes, and the type of that service is among no wheels.
    stand_in = target / "composition_interfaces" / "srv"
    stand_in.mkdir(parents=True)
    (stand_in.parent / "__init__.py").touch()
    (stand_in / "__init__.py").write_text("class LoadNode:\n    class Request: ...\n\n    class Response: ...\n")
    return target


@pytest.fixture
def ros2(machine: RosMachine, tools: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Ros2]:
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    with own_domain(tmp_path):
        command = Ros2(machine, tools, tmp_path)
        try:
            yield command
        finally:
            command("daemon stop")


def wait(condition: Callable[[], object], what: str) -> None:
    begun = time.monotonic()
    while not condition():
        assert time.monotonic() - begun < DEADLINE_S, f"{what}: not within {DEADLINE_S} s"
        time.sleep(0.2)


def left(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()} if folder.is_dir() else set()


RESULTS = {"result.json", "diagnosis.json", "report.html"}


@pytest.mark.ros
@pytest.mark.parametrize("drive", ["", "plan", "adaptive"])
def test_a_launch_of_the_simulation_leaves_what_a_run_leaves(ros2: Ros2, machine: RosMachine, drive: str):
    out = ros2.folder / "out"
    given = [f"plan:={machine.plan}", f"out:={out}", "allow_motion:=true"]
    if drive == "adaptive":
        goals = ros2.folder / "goals.yaml"
        goals.write_text("format: sdimu-goal/1\nname: rough\nminutes: 3\nlimits: {accel_bias: 5000 ug}\n")
        given.append(f"goals:={goals}")
    given += [f"drive:={drive}"] if drive else []
    ros2("launch sdimu_sim simulation_launch.py", *given, within_s=DEADLINE_S)
    assert RESULTS | {"bag", "truth.yaml"} <= left(out)


@pytest.mark.ros
def test_a_launch_ends_when_a_node_has_failed(ros2: Ros2):
    told = ros2("launch sdimu_sim simulation_launch.py", "goals:=none", "drive:=adaptive", within_s=DEADLINE_S)
    assert "goal" in told
    assert "adaptive" in told.split("has failed")[0]


@pytest.mark.ros
def test_a_launch_of_a_replay_leaves_what_a_run_leaves(ros2: Ros2, bag: Path):
    out = ros2.folder / "out"
    given = [f"bag:={bag}", f"out:={out}", "imu:=dtg", "site:=daejeon"]
    assert ros2("run sdimu_calibration sdimu", "--version").strip()
    ros2("launch sdimu_calibration replay_launch.py", *given, within_s=DEADLINE_S)
    assert left(out) >= RESULTS


@pytest.mark.ros
def test_a_driver_is_calibrated_asked_and_saved_by_the_documented_commands(ros2: Ros2, bag: Path):
    out = ros2.folder / "out"
    begin = "launch sdimu_calibration driver_launch.py"
    driver = "run sdimu_calibration replay_node --ros-args -r imu/data_raw:=/my_imu/data"
    given = ["imu_topic:=/my_imu/data", "imu:=dtg", "site:=daejeon", f"out:={out}"]
    playing = ["-p", f"bag:={bag}", "-p", "speed:=1.0", "-p", "consumers:=1"]
    with ros2.running(begin, *given), ros2.running(driver, *playing):
        wait(lambda: "/calibration/estimates" in ros2("topic list"), "the calibration node")
        assert "gyro_bias_x" in ros2("topic echo /calibration/estimates --once", within_s=DEADLINE_S)
        assert "effects beyond the model's" in ros2("param describe /calibration add")
        assert "successful" in ros2("param set /calibration add", "['gyro_scale_asymmetry_y']")
        assert "read-only" in ros2("param set /calibration site elsewhere")
        # A test that has been going for a while.
        wait(lambda: (out / "calibration.journal").stat().st_size > 100_000, "samples")
        time.sleep(20.0)
        assert "success=True" in ros2("service call /calibration/save std_srvs/srv/Trigger")
        wait(lambda: left(out) >= RESULTS, "results")
    result = ros2.folder / "out" / "result.json"
    begin = "run sdimu_calibration compensate_node --ros-args -p"
    with ros2.running(begin, f"result:={result}", "-p", "stay:=true"):
        assert "success=True" in ros2("service call /compensate/reload std_srvs/srv/Trigger")


@pytest.mark.ros
def test_a_table_moves_by_the_documented_commands_and_not_without(ros2: Ros2, machine: RosMachine):
    out = ros2.folder / "out"
    table = "run rate_table_sim rate_table_node --ros-args -p follow_goals:=true -p speed:=5.0 -p idle_speed:=5.0"
    given = ["table:=ideal", f"plan:={machine.plan}", f"out:={out}", "imu:=dtg", "site:=daejeon", "allow_motion:=true"]
    begin = "launch sdimu_calibration driver_launch.py"
    with ros2.running(table), ros2.running("run sdimu_sim sdimu_node --ros-args", "-p", f"truth_file:={out}.yaml"):
        with ros2.running(begin, *given):
            wait(lambda: "/table_goals/question" in ros2("topic list"), "the table's driver")
            assert "deg" in ros2(
                "topic echo /table_goals/question", QUESTION, "--once", "--full-length", within_s=DEADLINE_S
            )
            assert "success=True" in ros2("service call /table_goals/confirm std_srvs/srv/SetBool", "{data: true}")
            assert "success=True" in ros2("service call /rate_table/hold std_srvs/srv/Trigger")
            assert "success=True" in ros2("service call /rate_table/resume std_srvs/srv/Trigger")
            assert "successful" in ros2("param set /table_goals allow_motion false")
        ros2("service call /rate_table/stop std_srvs/srv/Trigger")
        ros2("service call /rate_table/finish std_srvs/srv/Trigger")
