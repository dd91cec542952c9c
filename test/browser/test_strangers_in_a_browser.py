"""Names that a file brings are shown as they are written, and pages of others get nothing from a workbench."""

from __future__ import annotations

import shutil
import subprocess
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest
from plans import SEED, quick_plan

from sdimu_calibration.storage.files.config import config_folder
from sdimu_calibration.storage.files.plan_file import write_plan

from .bench_page import add_own
from .conftest import FLAGS, PLACES, START_S, free_port, sdimu, serving, settle

MARK = "<img src=x onerror=window.owned=1>"
SCRIPT = "</script><script>window.owned=1</script>"
LINK = '<a href="javascript:window.owned=1">b'
EFFECT = f"""format: sdimu-effect/1
name: bent
title: '{MARK}{SCRIPT}{LINK}'
expressions:
  accel_x: k * ax**2
parameters:
  k: {{unit: ug/g^2, prior: 50 ug/g^2}}
"""
LEFT = """() => {
    const to = a => a.getAttribute('href') || a.getAttribute('xlink:href');
    const links = [...document.querySelectorAll('a')].filter(a => /^\\s*javascript:/i.test(to(a)));
    return [window.owned === undefined, document.querySelectorAll('img[src="x"]').length, links.length];
}"""
"""Whether no script ran, and how many pictures and links of the names are in the page."""


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A recording and an IMU file whose names are markup."""
    folder = tmp_path_factory.mktemp("hostile")
    bag, imu, plan = folder / f"{MARK}{LINK}", folder / f"{MARK}.yaml", folder / "quick.yaml"
    write_plan(plan, quick_plan(dwell_s=20.0))
    shutil.copy(config_folder() / "imu" / "dtg.yaml", imu)
    making = sdimu("simulate", "--plan", plan, "--rate", 20, "--seed", SEED, "--serial", SCRIPT, "--out", bag)
    subprocess.run(making, check=True, capture_output=True, timeout=START_S)
    return bag, imu


@pytest.fixture(scope="module")
def port(browser: Any, hostile: tuple[Path, Path]) -> Iterator[int]:  # noqa: ARG001
    bag, imu = hostile
    at = free_port()
    with serving(at, bag, "--imu", imu):
        yield at


def test_markup_in_names_is_text_in_the_workbench(browser: Any, port: int) -> None:
    page = browser.new_page()
    page.set_default_timeout(180_000)
    page.goto(f"http://127.0.0.1:{port}/")
    settle(page)
    add_own(page, EFFECT)
    settle(page)
    assert MARK in page.inner_text("body") or MARK in page.evaluate("document.body.textContent")
    assert page.evaluate(LEFT) == [True, 0, 0]
    page.close()


def test_markup_in_names_is_text_in_a_report(browser: Any, hostile: tuple[Path, Path], tmp_path: Path) -> None:
    bag, imu = hostile
    effect = tmp_path / "e.yaml"
    effect.write_text(EFFECT, encoding="utf-8")
    out = tmp_path / SCRIPT.replace("/", "_")
    command = sdimu("diagnose", bag, "--imu", imu, "--add", effect, "--out", out)
    done = subprocess.run(command, check=False, capture_output=True, timeout=START_S)
    assert (out / "report.html").is_file(), done.stderr
    page = browser.new_page()
    page.goto((out / "report.html").as_uri())
    assert MARK in page.title()
    page.wait_for_function("document.querySelector('.js-plotly-plot')")
    assert page.evaluate(LEFT) == [True, 0, 0]
    page.close()


ASK = """async port => {
    const at = path => `http://127.0.0.1:${port}${path}`, said = [];
    const asked = [
        [at('/_dash-layout'), {}],
        [at('/_dash-update-component'), {method: 'POST', headers: {'Content-Type': 'application/json'}, body: '{}'}],
    ];
    for (const [url, how] of asked) said.push(await fetch(url, how).then(r => `read ${r.status}`, () => 'nothing'));
    await fetch(at('/_dash-update-component'), {method: 'POST', mode: 'no-cors', body: '{}'});
    return said;
}"""


@pytest.fixture
def neighbour() -> Iterator[str]:
    """Another server of this machine, with a page that shows what it likes."""

    class Page(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(f'<iframe src="{self.path[1:]}"></iframe>'.encode())

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Page)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()


def test_a_page_of_another_server_reads_changes_and_frames_nothing(browser: Any, port: int, neighbour: str) -> None:
    page, statuses = browser.new_page(), []
    page.on("response", lambda answer: statuses.append((answer.request.method, answer.status)))
    page.goto(f"{neighbour}/http://127.0.0.1:{port}/")
    assert page.evaluate(ASK, port) == ["nothing", "nothing"]
    assert ("POST", 403) in statuses
    (_, frame) = page.frames
    assert "Diagnosis" not in frame.content()
    assert "refused to connect" in frame.inner_text("body")
    page.close()


def test_a_name_that_comes_to_point_to_this_machine_is_refused(port: int) -> None:
    """DNS rebinding: the page's own name leads here, so that the browser takes the workbench for the page's server."""
    chromium = next(filter(None, map(shutil.which, PLACES)))
    done = subprocess.run(
        [
            chromium,
            *FLAGS,
            "--headless",
            "--host-resolver-rules=MAP evil.example 127.0.0.1",
            "--dump-dom",
            f"http://evil.example:{port}/",
        ],
        check=True,
        capture_output=True,
        text=True,
        timeout=START_S,
    )
    assert "Only this machine is answered." in done.stdout
