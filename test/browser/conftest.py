"""A workbench as a person starts it, and Chromium in front of it; where there is none, skipped, and why is said."""

from __future__ import annotations

import select
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from plans import HIDDEN, SEED, quick_plan

from sdimu_calibration.storage.files.plan_file import write_plan

START_S = 300.0  # a first run on a new machine compiles
PLACES = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
SIZE = "40 ug/g^2"  # twenty-five times what the quick plan sees at one sigma
DWELL_S = 40.0
"""Duration of a stop (s)."""


def sdimu(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "sdimu_calibration.cli.main", *map(str, arguments)]


@dataclass
class Workbench:
    """A running workbench: its address and the folder of its recordings."""

    url: str
    folder: Path
    bag: Path


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    chromium = next(filter(None, map(shutil.which, PLACES)), None)
    if chromium is None:
        pytest.skip("no Chromium on this machine (Debian: the package chromium)")
    playwright = pytest.importorskip("playwright.sync_api", reason="no playwright in this environment (make setup)")
    with playwright.sync_playwright() as driver:
        shown = driver.chromium.launch(executable_path=chromium, headless=True, args=list(FLAGS))
        yield shown
        shown.close()


@pytest.fixture(scope="module")
def workbench(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Workbench]:  # noqa: ARG001
    """A recording with a hidden effect, and a broken one beside it."""
    folder = tmp_path_factory.mktemp("recordings")
    bag, plan = folder / "hidden", tmp_path_factory.mktemp("plan") / "quick.yaml"
    write_plan(plan, quick_plan(dwell_s=DWELL_S))
    given = ("--plan", plan, "--rate", 20, "--seed", SEED, "--effect", f"{HIDDEN}={SIZE}")
    making = sdimu("simulate", *given, "--out", bag)
    subprocess.run(making, check=True, capture_output=True, timeout=START_S)
    (folder / "broken.mcap").write_bytes(b"this is no recording")
    port = free_port()
    with serving(port, bag):
        yield Workbench(f"http://127.0.0.1:{port}/", folder, bag)


def free_port() -> int:
    """Find a port that nobody listens on: two workers serve at once."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


@contextmanager
def serving(port: int, *arguments: object) -> Iterator[subprocess.Popen[str]]:
    """Serve a workbench until the end of the block, or until it is ended there."""
    process = subprocess.Popen(
        sdimu("workbench", *arguments, "--port", port), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    try:
        _wait_until_it_says("http://", process)
        yield process
    finally:
        process.terminate()
        process.wait(20)


def _wait_until_it_says(word: str, process: subprocess.Popen[str]) -> None:
    assert process.stdout is not None
    said, deadline = "", time.monotonic() + START_S
    while time.monotonic() < deadline and process.poll() is None:
        if select.select([process.stdout], [], [], 0.5)[0]:
            said += process.stdout.readline()
            if word in said:
                return
    pytest.fail(f"the workbench did not start: {said}")


@pytest.fixture
def visit(browser: Any, workbench: Workbench) -> Iterator[Callable[[], Any]]:
    """Open the workbench as another person, in a session of its own; a complaint of the console fails the test."""
    complaints: list[str] = []
    contexts: list[Any] = []

    def another() -> Any:
        context = browser.new_context(viewport={"width": 1280, "height": 720}, accept_downloads=True)
        contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(180_000)  # a machine that is busy takes its time
        page.on("console", lambda said: complaints.append(said.text) if said.type in {"error", "warning"} else None)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(workbench.url)
        settle(page)
        return page

    yield another
    for context in contexts:
        context.close()
    assert complaints == []


_SETTLED = """
(() => {
  const drawn = name => document.querySelector(`#${name} .js-plotly-plot`)?._fullData?.length;
  return document.querySelector('#verdict')?.textContent && document.querySelector('#busy').hidden
    && !document.querySelector('[data-dash-is-loading]')
    && ['heat', 'residuals', 'ranking', 'ladder'].every(drawn);
})()
"""


def broken_rules(page: Any) -> list[str]:
    """Rules of axe-core that a page breaks seriously, with the first place of each.

    Figures are left to the test of the palette: axe takes minutes over their thousands of marks.
    """
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="no axe-core here (make setup)")
    found = axe.Axe().run(page, {"exclude": [[".figure"], [".js-plotly-plot"]]}).response["violations"]
    return [
        f"{rule['id']}: {rule['nodes'][0]['html'][:200]}" for rule in found if rule["impact"] in {"serious", "critical"}
    ]


_CROSSING = """() => Array.from(document.querySelectorAll('.js-plotly-plot')).flatMap(figure => {
    const upright = e => !/rotate\\((?!-90|0)/.test(e.getAttribute('transform') || '');
    const boxes = places => Array.from(figure.querySelectorAll(places)).filter(e => e.textContent.trim() && upright(e))
        .map(e => [e.textContent, e.getBoundingClientRect()]);
    const over = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1
        && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 4;
    const told = (one, others) => others.filter(([, box]) => over(one[1], box))
        .map(([other]) => `${figure.id}: ${one[0]} / ${other}`);
    const layout = figure._fullLayout, at = figure.getBoundingClientRect();
    const axes = Object.keys(layout).filter(key => /^xaxis\\d*$/.test(key) && layout[key].visible);
    const panels = axes.map(key => {
        const x = layout[key], y = layout[key.replace('x', 'y')];
        const left = at.left + x._offset, top = at.top + y._offset;
        return [`panel ${key}`, {left, right: left + x._length, top, bottom: top + y._length}];
    });
    const words = boxes('[class$="tick"] text, [class*="-"] > text[class$="title"]');
    return boxes('[class*="g-y"] > text').flatMap(one => told(one, panels))
        .concat(words.flatMap((one, k) => told(one, words.slice(k + 1))));
})"""
"""Labels of a figure that lie upon each other by more than the room that a font leaves around a word, or in a panel."""


def crossing_labels(page: Any) -> list[str]:
    """Name the labels of axes that cross another one of their figure, or a panel."""
    found: list[str] = page.evaluate(_CROSSING)
    return found


WIDE_4K = {"width": 3840, "height": 2160}
"""A screen of 4K (px)."""
LEAST_PX = 12
"""Height of letters (px) below which nobody reads them on a screen of 4K."""
_UNFIT = """least => {
    const words = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT), found = [];
    for (let node = words.nextNode(); node; node = words.nextNode()) {
        const at = node.parentElement, seen = node.textContent.trim() && at.getClientRects().length;
        const size = parseFloat(getComputedStyle(at).fontSize);
        if (seen && size < least) { found.push(`${size} px: ${node.textContent.trim().slice(0, 40)}`); }
    }
    const wide = Array.from(document.querySelectorAll('html, .card')).filter(e => e.scrollWidth > e.clientWidth + 1);
    return found.concat(wide.map(e => `wider than its place: ${e.tagName} ${e.id} ${e.textContent.slice(0, 40)}`));
}"""
"""What is written in smaller letters than `least` (px), and what is wider than its place."""


def unfit(page: Any) -> list[str]:
    """Name what is too small to read on a screen of 4K, and what runs out of its place."""
    found: list[str] = page.evaluate(_UNFIT, LEAST_PX)
    return found


_SEEN = """number => {
    const seen = document.querySelector('#ranking .js-plotly-plot')._hoverdata;
    return Boolean(seen) && seen[0].pointNumber === number;
}"""
"""Whether the mouse is on a bar, as the figure sees it."""


def settle(page: Any) -> None:
    """Wait until nothing is being worked on, verdict and candidates included."""
    # One callback follows another: still the same after a moment means the last one is done.
    for _ in range(3):
        page.wait_for_function(_SETTLED)
        page.wait_for_timeout(300)


def click_bar(page: Any, number: int) -> None:
    """Click a bar of the ranking once the figure sees the mouse on it: a click before that is lost."""
    bar = page.locator("#ranking .point path").nth(number)
    for _ in range(50):
        # Plotly listens on a layer above the bars, so the place is clicked, not the element.
        bar.evaluate("bar => bar.scrollIntoView({block: 'center'})")
        box = bar.bounding_box()
        middle = (box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
        page.mouse.move(box["x"] + 0.4 * box["width"], middle[1])
        page.mouse.move(*middle)
        page.wait_for_timeout(200)
        if page.evaluate(_SEEN, number):
            page.mouse.click(*middle)
            return
    raise AssertionError(f"the ranking does not see the mouse on bar {number}")
