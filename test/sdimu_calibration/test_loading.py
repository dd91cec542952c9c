"""Ctrl-C while a program still loads ends it without a traceback, as Ctrl-C does later."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from importlib.metadata import distribution

import pytest

PACKAGES = ("sdimu_calibration", "sdimu_sim", "rate_table_sim")
PROGRAMS = {
    point.name: point.value
    for package in PACKAGES
    for point in distribution(package).entry_points
    if point.group == "console_scripts"
}
SLOW = """import sys, time
sys.stdout.write("loading\\n")
sys.stdout.flush()
time.sleep(60)
"""
"""Stands for a module that takes long to load."""


@pytest.fixture
def loading(tmp_path, request):
    """A program of these packages that waits for the first module that it loads from elsewhere."""
    for name in ("numpy", "rclpy", "typer"):
        (tmp_path / f"{name}.py").write_text(SLOW)
    module, _, function = PROGRAMS[request.param].partition(":")
    # Where the tests run in the background, Ctrl-C is ignored, and a command would go on ignoring it.
    heeds = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    code = f"{heeds}; from {module} import {function}; {function}()"
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    with subprocess.Popen(
        [sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "loading\n"
        yield process
        process.kill()


@pytest.mark.parametrize("loading", PROGRAMS, indirect=True)
def test_a_program_that_loads_ends_at_ctrl_c_without_a_traceback(loading, request):
    loading.send_signal(signal.SIGINT)
    _, wrong = loading.communicate(timeout=20)
    # A node that is stopped has done what it was asked for; a command has not.
    expected = 130 if "[sdimu]" in request.node.name else 0
    assert (loading.returncode, wrong) == (expected, "")
