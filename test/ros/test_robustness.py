"""Nodes that come late, stop, or are killed."""

from __future__ import annotations

import signal
import time
from pathlib import Path

import numpy as np
import pytest

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.nodes.monitor import Monitor
from sdimu_calibration.storage.bags.bag_reader import read_recording
from sdimu_calibration.storage.bags.recover import recover
from sdimu_calibration.storage.files.result_file import read_result

from .conftest import DEADLINE_S, RATE_HZ, FitSession, imu_stamps, samples_of, write_plan

pytestmark = pytest.mark.ros

NODES = ("recorder", "calibration", "sdimu", "rate_table")
INTERVAL_NS = 10**9 // RATE_HZ
OWN = """format: sdimu-effect/1
name: coupling
title: force times rate
expressions: {accel_z: k1 * ax * wz}
parameters:
  k1: {unit: ug*s/deg/g, prior: 50 ug*s/deg/g}
"""


@pytest.mark.parametrize("order", [NODES, NODES[::-1]], ids=["table last", "recorder last"])
def test_a_node_may_come_late_and_nothing_is_lost(bench: FitSession, order: tuple[str, ...]) -> None:
    """Of each two nodes either comes late in one of the orders; the live node estimates what `--add` would."""
    dwell_s = 12.0
    write_plan(bench.plan, dwell_s)
    own = bench.folder / "coupling.yaml"
    own.write_text(OWN, encoding="utf-8")
    added = {"calibration": {"add": ["gyro_scale_asymmetry_x", "gyro_x: ey^2", str(own)]}}
    for name in order:
        bench.start(name, **added.get(name, {}))
        time.sleep(2.0)
    bench.wait_for_end()
    stamps = imu_stamps(bench.folder / "bag")
    assert len(stamps) == samples_of(dwell_s)
    assert set(np.diff(stamps)) == {INTERVAL_NS}
    result = read_result(bench.folder)
    assert result.data["samples"] == samples_of(dwell_s)
    # A name, an equation and a file in one parameter.
    assert result.names[-3:] == ("gyro_scale_asymmetry_x", "gyro_x: ey^2", "coupling_k1")


def test_a_killed_calibration_is_not_waited_for_and_its_successor_goes_on(bench: FitSession) -> None:
    write_plan(bench.plan, 60.0)
    bench.speed = 15.0
    for name in NODES:
        bench.start(name)
    bench.wait(lambda: bench.recorded_bytes() > 50_000, "a third of the data")
    bench.children.kill("calibration")
    bench.start("calibration", checkpoint=False)
    bench.wait_for_end()
    assert len(imu_stamps(bench.folder / "bag")) == samples_of(60.0)
    # The successor knows what came after it; it started in the first half.
    taken = read_result(bench.folder).data["samples"]
    assert samples_of(60.0) / 4 < taken < samples_of(60.0)


def test_a_node_that_gets_no_core_for_some_seconds_loses_nothing(bench: FitSession) -> None:
    """As on a machine with more work than cores. With a lease of 3 s the others forgot it, and 25 s were missing."""
    write_plan(bench.plan, 60.0)
    bench.speed = 20.0
    for name in NODES:
        bench.start(name)
    bench.wait(lambda: bench.recorded_bytes() > 50_000, "a third of the data")
    process = bench.children._children["calibration"].process
    process.send_signal(signal.SIGSTOP)
    time.sleep(4.5)
    process.send_signal(signal.SIGCONT)
    bench.wait_for_end()
    assert read_result(bench.folder).data["samples"] == samples_of(60.0)
    assert len(imu_stamps(bench.folder / "bag")) == samples_of(60.0)


def test_a_killed_recorder_loses_at_most_a_second_and_stalls_nobody(bench: FitSession) -> None:
    write_plan(bench.plan, 60.0)
    bench.speed = 20.0
    for name in NODES:
        bench.start(name)
    monitor = Monitor()
    try:
        bench.wait(lambda: monitor.listen(0.05).table_s > 60.0, "a third of the data")
        bench.children.kill("recorder")
        reached_s = monitor.progress.table_s
    finally:
        monitor.close()
    # Whoever waited for the dead recorder would wait for ever: the others end, however busy the machine is.
    bench.wait_for_end()
    assert read_result(bench.folder).data["samples"] == samples_of(60.0)
    with pytest.raises(DataError, match="recover"):
        read_recording(bench.folder / "bag")
    recover(bench.folder / "bag")
    stamps = imu_stamps(bench.folder / "bag")
    assert set(np.diff(stamps)) == {INTERVAL_NS}
    # One second of wall time, and what was on its way: two windows of two seconds of data.
    assert len(stamps) / RATE_HZ > reached_s - bench.speed * 1.0 - 4.0


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_a_stopped_recorder_closes_its_bag(bench: FitSession, how: signal.Signals) -> None:
    write_plan(bench.plan, 60.0)
    bench.speed = 20.0
    for name in NODES:
        bench.start(name)
    bench.wait(lambda: bench.recorded_bytes() > 25_000, "some data")
    assert bench.children.stop("recorder", how) == 0
    recording = read_recording(bench.folder / "bag")
    assert set(np.rint(np.diff(recording.t) * 1e9)) == {INTERVAL_NS}
    for name in ("rate_table", "sdimu", "calibration"):
        assert bench.children.stop(name, how) == 0


def test_a_node_that_fails_is_reported_in_one_line(bench: FitSession) -> None:
    complaints: list[str] = []
    bench.start("rate_table", plan="nowhere")

    def failed() -> bool:
        try:
            return not bench.children.running()
        except DataError as error:
            complaints.append(str(error))
            return True

    bench.wait(failed, "failure")
    assert "nowhere" in complaints[0]
    assert "\n" not in complaints[0]


def test_a_run_whose_calibration_dies_ends_with_one_line(tmp_path: Path) -> None:
    import psutil

    from .conftest import sdimu

    plan = write_plan(tmp_path / "plan.yaml", 60.0)
    process = sdimu("run", "--plan", plan, "--speed", 5, "--out", tmp_path / "run")
    parent = psutil.Process(process.pid)
    deadline = time.monotonic() + DEADLINE_S
    victim = None
    while victim is None and time.monotonic() < deadline:
        # The interpreter of the venv may start itself again before it is the node.
        nodes = [child for child in parent.children(recursive=True) if "calibration_node" in " ".join(child.cmdline())]
        victim = nodes[0] if nodes else None
        time.sleep(0.1)
    assert victim is not None
    others = parent.children(recursive=True)
    time.sleep(3.0)
    victim.kill()
    _, err = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 1
    assert len(err.splitlines()) == 1
    assert "calibration" in err
    assert not [child for child in others if child.is_running() and child.status() != psutil.STATUS_ZOMBIE]
