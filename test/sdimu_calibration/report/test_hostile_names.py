"""Names that users give are shown as they are: no mark in them becomes a part of a page or of a figure."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest

from sdimu_calibration.cli.datasheet import datasheet
from sdimu_calibration.cli.fleet import fleet
from sdimu_calibration.cli.predict import predict
from sdimu_calibration.core.noise import allan, fit_terms
from sdimu_calibration.core.results import SetRecording, SetSummary
from sdimu_calibration.report import data, evidence_figures
from sdimu_calibration.report.coefficients import prior_and_posterior
from sdimu_calibration.report.drawing import Figure
from sdimu_calibration.report.fleet.dots import dot_plot
from sdimu_calibration.report.fleet.figures import heat_map
from sdimu_calibration.report.noise import CHANNELS, write_page
from sdimu_calibration.report.page import Contents, page
from sdimu_calibration.storage.files.config import config_folder
from sdimu_calibration.storage.files.result_file import read_result, write_result
from sdimu_calibration.storage.trace import Trace

BOLD, IMAGE = "<b>x</b>", "<img src=x onerror=alert(1)>"


class Seen(HTMLParser):
    """Tags of a page, and the texts in its figures."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.images, self.bold, self.handlers, self.figures = 0, 0, 0, 0
        self.words: list[str] = []
        self._figure = self._bold = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.images += tag == "img"
        self.handlers += any(name.startswith("on") for name, _ in attrs)
        self._figure = tag == "script" and ("type", "application/json") in attrs
        self._bold = tag == "b"

    def handle_data(self, text: str) -> None:
        self.bold += self._bold and text == "x"
        if self._figure:
            self.figures += 1
            self.words += texts(json.loads(text))
            self._figure = False


def texts(content: Any) -> Iterator[str]:
    if isinstance(content, str):
        yield content
    elif isinstance(content, dict):
        for value in content.values():
            yield from texts(value)
    elif isinstance(content, list | tuple | np.ndarray):
        for value in content:
            yield from texts(value)


def marked(words: Any) -> list[str]:
    """Texts with a mark of the user's."""
    return [word for word in words if any(mark in word for mark in ("<img", "<b>x"))]


def assert_shown_as_it_is(text: str) -> None:
    seen = Seen(text)
    assert (seen.images, seen.bold, seen.handlers) == (0, 0, 0)
    assert seen.figures > 0
    assert marked(seen.words) == []
    # They are there: as text.
    assert "&lt;img" in text or "&lt;b&gt;x" in text


def in_figure(figure: Figure) -> list[str]:
    return [*texts(figure.data), *texts(figure.layout)]


@pytest.fixture
def hostile(batch):
    """Results of three units with such names wherever a user gives one."""
    folder = batch(units=3, out=1)
    for k, path in enumerate(sorted(folder.rglob("result.json"))):
        one = read_result(path)
        said = {"serial": f"{k}{IMAGE}", "power_on": BOLD, "recording": IMAGE, "imu": IMAGE, "site": BOLD}
        names = (f"gyro_bias_{IMAGE}", *one.names[1:])
        write_result(path, replace(one, names=names, origin=replace(one.origin, **said), notes=(IMAGE,)))
    return folder


def test_the_page_of_a_set_shows_names_of_recordings_as_they_are(hostile):
    one = read_result(hostile / "unit0_0")
    some = np.linspace(-1.0, 1.0, len(one.names))
    recordings = tuple(
        SetRecording(name, IMAGE, BOLD, 10**18, 21.0, 60.0, 10.0, 1.0, some, np.abs(some), some)
        for name in (BOLD, IMAGE)
    )
    of_set = SetSummary(recordings, (), (), some, (), left_out=((IMAGE, BOLD),))
    trace = Trace("now", "sdimu", f"sdimu calibrate '{IMAGE}'", (("imu", IMAGE),), ((IMAGE, "0"),))
    assert_shown_as_it_is(page(replace(one, of_set=of_set), Contents(IMAGE, trace=trace)))


def test_the_pages_of_a_fleet_show_serials_as_they_are(hostile, tmp_path):
    fleet([hostile], out=tmp_path / "out")
    assert_shown_as_it_is((tmp_path / "out" / "fleet.html").read_text())
    datasheet([hostile], out=tmp_path / "out")
    seen = Seen((tmp_path / "out" / "datasheet.html").read_text())
    assert (seen.images, seen.bold, seen.handlers) == (0, 0, 0)


def test_a_cross_in_the_map_of_a_fleet_stands_where_its_unit_does(hostile, monkeypatch):
    from sdimu_calibration.report.fleet import page as fleet_page

    drawn = []
    monkeypatch.setattr(fleet_page, "heat_map", lambda done: drawn.append(heat_map(done)) or drawn[-1])
    monkeypatch.setattr(fleet_page, "dot_plot", lambda *given: drawn.append(dot_plot(*given)) or drawn[-1])
    fleet([hostile], out=hostile)
    (cells,) = (figure for figure in drawn if figure.data[0]["type"] == "heatmap")
    for cross in cells.layout["annotations"]:
        assert cross["x"] in cells.data[0]["x"]
        assert cross["y"] in cells.data[0]["y"]
    assert marked(word for figure in drawn for word in in_figure(figure)) == []


def test_a_page_of_a_noise_and_of_a_plan_shows_names_of_files_as_they_are(tmp_path):
    rng = np.random.default_rng(1)
    found = {channel: allan([rng.standard_normal(400)], 0.01) for channel in CHANNELS}
    terms = {channel: fit_terms(one, rng) for channel, one in found.items()}
    write_page(tmp_path / "noise.html", found, terms, f"Noise of {IMAGE}", [BOLD])
    assert_shown_as_it_is((tmp_path / "noise.html").read_text())
    for kind, name in (("plan", "kim18"), ("imu", "dtg")):
        text = (config_folder() / kind / f"{name}.yaml").read_text()
        (tmp_path / f"{kind}.yaml").write_text(text.replace(f"name: {name}", f'name: "{IMAGE}"'))
    predict(str(tmp_path / "plan.yaml"), str(tmp_path / "imu.yaml"), out=tmp_path / "out")
    assert_shown_as_it_is((tmp_path / "out" / "prediction.html").read_text())


def test_figures_of_effects_show_labels_as_they_are(hostile):
    one = read_result(hostile / "unit0_0")
    part = data.Explained(IMAGE, np.arange(9.0), np.arange(9.0))
    figures = (
        evidence_figures.explained([part]),
        evidence_figures.correlation([BOLD, IMAGE], np.eye(2)),
        prior_and_posterior(one, dict.fromkeys(one.names, 1.0)),
        evidence_figures.deviates([BOLD], [IMAGE], np.ones((1, 1)), "recording", "coefficient", 300),
    )
    for figure in figures:
        assert marked(in_figure(figure)) == []
