"""`sdimu run --open` at its full pace: the page in Chromium keeps up, costs the test no sample, and has its numbers."""

from __future__ import annotations

import json
import re
import socket
import subprocess
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sdimu_calibration.core.evidence.consistency import CHANNEL_NAMES
from sdimu_calibration.report.markup import signs
from sdimu_calibration.storage.files.config import load_plan

from .conftest import START_S, free_port, sdimu

pytestmark = pytest.mark.ros
RATE_HZ = 100
"""Rate of a usual test: 298,000 samples of the default plan."""
PACE = 100.0
"""Times real time that a test must reach with its page open."""


@dataclass
class Watched:
    """A test that was watched in a browser to its end."""

    folder: Path
    said: str
    sentence: str
    stops: list[str]
    heat: np.ndarray
    complaints: list[str]

    def measured(self) -> tuple[float, int, int]:
        """Pace (times real time), samples recorded and lost, as the shell says them."""
        line = r"data: (\d+) times .* (\d+) samples recorded, (\d+) lost"
        pace, taken, lost = re.search(line, " ".join(self.said.split())).groups()
        return float(pace), int(taken), int(lost)


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


@pytest.fixture(scope="module")
def watched(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Watched]:
    """A whole test of the default plan with a hidden effect, as fast as nothing gets lost, with its page open."""
    port, out = free_port(), tmp_path_factory.mktemp("live") / "run"
    hidden = ("--effect", "accel_quadratic_x=40 ug/g^2", "--rate", RATE_HZ, "--seed", 3)
    command = sdimu("run", *hidden, "--open", "--no-browser", "--port", port, "--out", out)
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    page = browser.new_page(viewport={"width": 1440, "height": 900})
    page.set_default_timeout(1000.0 * START_S)
    complaints: list[str] = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    try:
        wait_until_served(port, process)
        page.goto(f"http://127.0.0.1:{port}/")
        # Seen while the test runs: some of the eighteen stops.
        page.wait_for_function(r"/stop ([2-9]|1\d) of 18/.test(document.querySelector('#place')?.textContent ?? '')")
        page.wait_for_function("document.querySelector('#ended').classList.contains('good')")
        page.wait_for_function("document.querySelector('#verdict').textContent.includes('Up to stop 18')")
        page.wait_for_selector("#heat .js-plotly-plot", state="attached")
        heat = page.evaluate(
            "document.querySelector('#heat .js-plotly-plot')._fullData[0].z.map(row => Array.from(row))"
        )
        stops = page.evaluate("Array.from(document.querySelector('#heat .js-plotly-plot')._fullData[0].x)")
        sentence = page.inner_text("#verdict")
        said, err = process.communicate(timeout=START_S)
        assert process.returncode in {0, 3}, err
        yield Watched(out, said, sentence, stops, np.array(heat, dtype=float), complaints)
    finally:
        page.close()
        process.kill()
        process.wait(20)


def test_the_page_beside_a_run_costs_no_sample(watched: Watched) -> None:
    _, taken, lost = watched.measured()
    assert (taken, lost) == (round(load_plan("kim18").duration_s * RATE_HZ), 0)


def test_the_page_ends_with_the_numbers_of_the_shell(watched: Watched) -> None:
    found = json.loads((watched.folder / "diagnosis.json").read_text(encoding="utf-8"))
    assert signs(found["sentence"]) in watched.sentence
    assert watched.stops == [str(stop) for stop in range(19)]
    assert found["where"]
    for cell in found["where"]:
        at = CHANNEL_NAMES.index(cell["channel"]), watched.stops.index(str(cell["stop"]))
        # To the digit that a cell shows: the last diagnosis is made of the same samples, by another process.
        assert watched.heat[at] == pytest.approx(cell["normalised_mean"], abs=0.05), cell
    assert watched.complaints == []


@pytest.mark.bench
def test_a_test_with_its_page_open_runs_at_a_hundred_times_real_time(watched: Watched) -> None:
    """On an idle machine: each second of data is a round of messages, and whatever runs beside it makes them wait."""
    pace, _, _ = watched.measured()
    assert pace >= PACE
