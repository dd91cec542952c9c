"""`sdimu run --open` over DDS: the page follows the test, adds an effect, has every choice, and is told the end."""

from __future__ import annotations

import json
import socket
import time
import urllib.request
from pathlib import Path
from typing import Any

import pytest

from sdimu_calibration.report.markup import signs
from sdimu_calibration.storage.files.result_file import read_result

from .conftest import DEADLINE_S, sdimu

pytestmark = pytest.mark.ros
EFFECT = "accel_quadratic_x"


class Page:
    """A page that asks what is new, over HTTP."""

    def __init__(self, port: int) -> None:
        self._address = f"http://127.0.0.1:{port}/"
        self._values: dict[str, Any] = {"look.data": {"scale": 1, "theme": "light"}, "page.data": "a"}
        self._callbacks: list[dict[str, Any]] = []
        self.shown: dict[str, dict[str, Any]] = {}

    def is_there(self) -> bool:
        try:
            self._callbacks = json.load(
                urllib.request.urlopen(f"{self._address}_dash-dependencies", timeout=DEADLINE_S)
            )
        except OSError:
            return False
        return True

    def ask(self) -> None:
        """Fetch what is new."""
        new = self._post("known.data", "tick.n_intervals")
        self._values["known.data"] = new["known"]["data"]
        for place, values in new.items():
            self.shown.setdefault(place, {}).update(values)

    def add(self, effect: str) -> None:
        self._values |= {"candidate.value": effect, "add.n_clicks": 1}
        assert self._post("message.children", "add.n_clicks")["message"]["children"] == ""

    def text(self, place: str) -> str:
        return json.dumps(self.shown.get(place, {}).get("children", ""))

    def _post(self, output: str, changed: str) -> dict[str, Any]:
        (callback,) = [c for c in self._callbacks if output in c["output"] and c["clientside_function"] is None]
        parts = [o.rsplit(".", 1) for o in callback["output"].strip(".").split("...")]
        outputs = [{"id": part[0], "property": part[1]} for part in parts]
        body: dict[str, Any] = {
            kind: [{**p, "value": self._values.get(f"{p['id']}.{p['property']}")} for p in callback[kind]]
            for kind in ("inputs", "state")
        }
        body |= {"output": callback["output"], "changedPropIds": [changed]}
        body["outputs"] = outputs if callback["output"].startswith("..") else outputs[0]
        asked = urllib.request.Request(
            f"{self._address}_dash-update-component", json.dumps(body).encode(), {"Content-Type": "application/json"}
        )
        answer: dict[str, Any] = json.load(urllib.request.urlopen(asked, timeout=DEADLINE_S))["response"]
        return answer


def test_a_page_follows_a_run_to_its_end(tmp_path: Path, apart: int) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = int(free.getsockname()[1])
    out, page = tmp_path / "run", Page(port)
    run = sdimu(
        "run",
        "--adaptive",
        "table33",
        "--rate",
        20,
        "--speed",
        10,
        "--open",
        "--no-browser",
        "--port",
        port,
        "--domain",
        apart,
        "--out",
        out,
    )
    begun, added = time.monotonic(), False
    try:
        while not page.is_there():
            assert run.poll() is None
            assert time.monotonic() - begun < DEADLINE_S
            time.sleep(0.3)
        while not page.shown.get("tick", {}).get("disabled"):
            page.ask()
            if not added and "stop 2" in page.text("place"):
                page.add(EFFECT)
                added = True
            assert time.monotonic() - begun < DEADLINE_S
            time.sleep(0.5)
        said, err = run.communicate(timeout=DEADLINE_S)
    finally:
        run.kill()
    assert run.returncode in {0, 3}, err
    assert f"live page at http://127.0.0.1:{port}" in said
    assert f"The test has ended; results in {out}" in page.text("ended")
    assert f"{EFFECT} is in the model" in page.text("answer")
    assert read_result(out).names[-1] == EFFECT
    choices = json.loads((out / "choices.json").read_text())["choices"]
    assert all(json.dumps(signs(choice["text"])).strip('"') in page.text("choices") for choice in choices)
    stops = page.shown["heat"]["figure"]["data"][0]["x"]
    turns = [choice["step"] for choice in choices if choice["step"] and choice["step"]["turn"]]
    assert len(stops) == 1 + len(turns)
    assert set(page.shown["nis"]["figure"]["data"][0]["x"]) <= set(stops)
    curves = page.shown["sigmas"]["figure"]["data"]
    assert len(curves) == 8
    assert all(min(filter(None, curve["y"])) < 0.2 for curve in curves[:7])
