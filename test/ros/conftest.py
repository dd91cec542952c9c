"""Real nodes over DDS: every test in a ROS domain of its own, bounded in time, and nothing left running."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from sdimu_calibration.cli.processes import Children, own_domain
from sdimu_calibration.storage.bags.bag_file import raw_messages
from sdimu_calibration.storage.bags.cdr import IMU, decode_imu

RATE_HZ = 50
"""Half of what a run takes unless told: every message is work for each of four nodes."""
DWELL_S = 40.0
TURN_S = 3.0
RECORDER = "sdimu_calibration.nodes.recorder_node"
CALIBRATION = "sdimu_calibration.nodes.calibration_node"
SDIMU = "sdimu_sim.nodes.sdimu_node"
TABLE = "rate_table_sim.nodes.rate_table_node"
DEADLINE_S = 400.0
"""Longest wait (s) of any test: a first run on a new machine compiles, and other tests keep both cores busy. No test
has a shorter one of its own: what takes 14 s alone took 120 s beside the others."""


def write_plan(path: Path, dwell_s: float) -> Path:
    """Three stops and two quarter turns of `TURN_S`."""
    path.write_text(
        f"format: sdimu-plan/1\nname: short\ndwell: {dwell_s} s\nrate: 30 deg/s\nacceleration: 60 deg/s^2\n"
        "turns:\n  - {axis: Y, angle: 90 deg}\n  - {axis: Z, angle: 90 deg}\n",
        encoding="utf-8",
    )
    return path


def samples_of(dwell_s: float) -> int:
    """IMU samples of such a plan: one for every interval, none at the start."""
    return round((3 * dwell_s + 2 * TURN_S) * RATE_HZ)


class FitSession:
    """The nodes of a test, to be started, killed and waited for one by one."""

    def __init__(self, folder: Path, children: Children) -> None:
        self.folder = folder
        self.children = children
        self.plan = folder / "plan.yaml"
        self.speed = 0.0

    def start(self, name: str, **more: object) -> None:
        parameters: dict[str, dict[str, object]] = {
            "recorder": {"out": str(self.folder / "bag"), "wait_for": ["/imu/data_raw", "/rate_table/status"]},
            # Most tests are not about the diagnosis, which costs a process and its time.
            "calibration": {"out": str(self.folder), "diagnose": False},
            "sdimu": {"rate_hz": float(RATE_HZ), "consumers": 2},
            "rate_table": {"plan": str(self.plan), "speed": self.speed, "consumers": 1},
        }
        parameters["rate_table"] |= {"status_peers": 2, "joint_peers": 1}
        modules = {"recorder": RECORDER, "calibration": CALIBRATION, "sdimu": SDIMU, "rate_table": TABLE}
        self.children.start(name, modules[name], parameters[name] | more)

    def wait(self, condition: Callable[[], bool], what: str) -> None:
        begun = time.monotonic()
        while not condition():
            assert time.monotonic() - begun < DEADLINE_S, f"{what}: not within {DEADLINE_S} s"
            time.sleep(0.05)

    def wait_for_end(self) -> None:
        self.wait(lambda: not self.children.running(), "end of all nodes")

    def recorded_bytes(self) -> int:
        return sum(file.stat().st_size for file in (self.folder / "bag").glob("*.mcap"))


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[FitSession]:
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)  # a free domain, whatever runs beside the tests
    with own_domain(tmp_path / "log"), Children(tmp_path / "log") as children:
        yield FitSession(tmp_path, children)


@pytest.fixture
def apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A domain for one run, which is found as the only one of this machine.

    Its own locks are in a folder of this test, so that no other run is found. The domain is held where the others look,
    too: two runs that took the same one would mix their samples.
    """
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    with own_domain(tmp_path / "log") as domain:
        monkeypatch.setenv("TMPDIR", str(tmp_path))
        yield domain


def imu_stamps(bag: Path) -> np.ndarray:
    """Stamps (ns) of the IMU samples in a bag, as recorded."""
    return decode_imu(raw_messages(bag, {"/imu/data_raw": IMU}, "/imu/data_raw")["/imu/data_raw"])[0]


def sdimu(*arguments: object) -> subprocess.Popen[str]:
    """Start a verb of `sdimu` as a person does."""
    command = [sys.executable, "-m", "sdimu_calibration.cli.main", *map(str, arguments)]
    free = {name: value for name, value in os.environ.items() if name != "ROS_DOMAIN_ID"}  # two runs at once
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=free)


@dataclass
class Run:
    """A whole test that has been run, and what it said."""

    folder: Path
    output: str


def runs(root: Path, number: int, dwell_s: float = DWELL_S, *more: str) -> list[Run]:
    """Run the same test several times at once, with more options."""
    plan = write_plan(root / "plan.yaml", dwell_s)
    folders = [root / f"run{k}" for k in range(number)]
    given = ("--plan", plan, "--rate", RATE_HZ, "--seed", 5, *more)
    processes = [sdimu("run", *given, "--out", folder) for folder in folders]
    done = []
    for folder, process in zip(folders, processes, strict=True):
        try:
            out, err = process.communicate(timeout=DEADLINE_S)
        finally:
            process.kill()
        assert process.returncode == 0, err
        done.append(Run(folder, out))
    return done


@pytest.fixture(scope="session")
def whole_run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return runs(tmp_path_factory.mktemp("run"), 1)[0]
