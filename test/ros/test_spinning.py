"""A node ends with one line, whatever fails on the way out."""

from __future__ import annotations

import subprocess
import sys

import pytest

from sdimu_calibration.storage.bags.recover import recover

from .conftest import DEADLINE_S

pytestmark = pytest.mark.ros

SHELL = """
from rclpy.node import Node
from rclpy.task import Future

from sdimu_calibration.nodes.spinning import run_node


class Shell:
    def __init__(self):
        self.node = Node("shell")
        self.done = Future()
        self.done.set_result(None)

    def close(self):
        raise OSError(28, "No space left on device\\x1b[2J", "out/bag")


run_node(Shell)
"""
RECORDER = """
import sys
from pathlib import Path

from sdimu_calibration.nodes.recorder_node import RecorderNode
from sdimu_calibration.nodes.spinning import run_node


def full():
    recorder = RecorderNode()
    bag = recorder._bag
    bag.write("/imu/temperature", bytes(40), 5)
    bag.flush()
    bag.write("/imu/temperature", bytes(40), 6)
    bag._writer._stream = open("/dev/full", "wb", buffering=0)
    return recorder


run_node(full, ["--ros-args", "-p", f"out:={sys.argv[1]}"])
"""


def run(code, *arguments):
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE_S, check=False)


def test_a_full_disk_on_the_way_out_is_one_line():
    done = run(SHELL)
    assert done.returncode == 1
    assert "No space left" in done.stderr
    assert done.stderr.count("\n") == 1
    assert "\x1b" not in done.stderr


def test_a_full_disk_ends_the_recorder_with_one_line_and_a_bag_to_mend(tmp_path):
    bag = tmp_path / "bag"
    done = run(RECORDER, str(bag))
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert "bag: the bag cannot be written (No space left on device)" in done.stderr
    (salvage,) = recover(bag)
    assert salvage.counts["/imu/temperature"] == 1
