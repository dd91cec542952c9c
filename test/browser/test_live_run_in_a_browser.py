"""`sdimu run --open` at its full pace: the page in Chromium keeps up, costs the test no sample, and has its numbers."""

from __future__ import annotations

import json
import re
import socket
import subprocess
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sdimu_calibration.core.evidence.consistency import CHANNEL_NAMES
from sdimu_calibration.report.markup import signs
from sdimu_calibration.storage.files.config import load_plan

from .conftest import START_S, free_port, sdimu

pytestmark = pytest.mark.ros
RATE_HZ = 20
"""A fifth of the usual rate: tests that run beside this one take their part of the processor from its pace."""
PACE = 100.0
"""Times real time that a test must reach with its page open."""


@pytest.fixture
def running(tmp_path: Path) -> Any:
    """A whole test of the default plan with a hidden effect, as fast as nothing gets lost, and the port of its page."""
    port = free_port()
    hidden = ("--effect", "accel_quadratic_x=40 ug/g^2", "--rate", RATE_HZ, "--seed", 3)
    command = sdimu("run", *hidden, "--open", "--no-browser", "--port", port, "--out", tmp_path / "run")
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    yield process, port
    process.kill()
    process.wait(20)


def wait_until_served(port: int, process: subprocess.Popen[str]) -> None:
    """Wait until somebody listens."""
    deadline = time.monotonic() + START_S
    while True:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.1)


def test_the_page_beside_a_run_at_a_hundred_times_real_time_costs_no_sample_and_has_its_numbers(
    browser: Any, running: tuple[subprocess.Popen[str], int], tmp_path: Path
) -> None:
    process, port = running
    page = browser.new_page(viewport={"width": 1440, "height": 900})
    page.set_default_timeout(1000.0 * START_S)
    complaints: list[str] = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    wait_until_served(port, process)
    page.goto(f"http://127.0.0.1:{port}/")
    # Seen while the test runs: some stops of the eighteen, not all of them.
    page.wait_for_function(r"/stop ([2-9]|1\d) of 18/.test(document.querySelector('#place').textContent)")
    page.wait_for_function("document.querySelector('#ended').classList.contains('good')")
    page.wait_for_function("document.querySelector('#verdict').textContent.includes('Up to stop 18')")
    shown = page.evaluate("document.querySelector('#heat .js-plotly-plot')._fullData[0].z.map(row => Array.from(row))")
    stops = page.evaluate("Array.from(document.querySelector('#heat .js-plotly-plot')._fullData[0].x)")
    sentence = page.inner_text("#verdict")
    page.close()
    said, err = process.communicate(timeout=START_S)
    assert process.returncode in {0, 3}, err

    told = " ".join(said.split())
    pace, taken, lost = map(float, re.search(r"data: (\d+) times .* (\d+) samples recorded, (\d+) lost", told).groups())
    plan = load_plan("kim18")
    assert pace >= PACE
    assert (taken, lost) == (round(plan.duration_s * RATE_HZ), 0)

    found = json.loads((tmp_path / "run" / "diagnosis.json").read_text(encoding="utf-8"))
    assert signs(found["sentence"]) in sentence
    assert stops == [str(stop) for stop in range(19)]
    grid = np.array(shown, dtype=float)
    for cell in found["where"]:
        at = CHANNEL_NAMES.index(cell["channel"]), stops.index(str(cell["stop"]))
        # To the digit that a cell shows: the last diagnosis is made of the same samples, by another process.
        assert grid[at] == pytest.approx(cell["normalised_mean"], abs=0.05), cell
    assert complaints == []
