"""The live page in front of a person: it grows, a candidate is clicked and added, the end and a loss are told."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from werkzeug.serving import make_server

from sdimu_calibration.report.glossary import WORDS
from sdimu_calibration.report.live_page.app import build
from sdimu_calibration.report.live_page.record import End, LiveRecord
from sdimu_calibration.report.live_seen import Outline
from sdimu_calibration.report.live_text import SeenChoice, SeenDiagnosis

from .conftest import broken_rules

TEST = Outline(900.0, 4, ("gyro_bias", "accel_scale"), {"gyro_bias_x": "deg/h", "accel_scale_x": "ppm"})
ABOUT = ["out/run", "plan kim18", "IMU dtg", "daejeon"]
EFFECT = "gyro_scale_asymmetry_y"
CHANNELS = tuple(f"{what}_{axis}" for what in ("position", "velocity", "gyro", "accel") for axis in "xyz")


class Now:
    """A test that has reached some stop."""

    def __init__(self, stop: int) -> None:
        self.stop, self.phase, self.verdict = stop, "dwell", "consistent"
        self.table_s = self.filter_s = 200.0 * stop + 100.0
        self.first = {"gyro_bias_x": 1e-5, "accel_scale_x": 1e-4}
        self.sigmas = {name: sigma / (1.0 + stop) for name, sigma in self.first.items()}
        self.nis = {"rate": 1.1, "force": 0.9}
        self.nis_by_stop = dict.fromkeys(range(stop + 1), self.nis)
        stops = tuple(map(str, range(stop + 1)))
        heat = np.outer(np.arange(12.0) - 6.0, np.ones(stop + 1))
        rank = ((EFFECT, "+27.4 sigma, 41 ppm"), ("accel_quadratic_z", "+9.1 sigma, 30 ug/g^2"))
        self.ladders = dict.fromkeys(range(1, stop + 1), (("as given", "2.42"),))
        said, noise = "2 candidates stand out of the noise.", "noise reaches 3.8"
        self.diagnosis = SeenDiagnosis(
            stop, "misfit", said, noise, rank, self.ladders[stop], CHANNELS, stops, heat, standing=2
        )
        self.choices = [SeenChoice("Y +90 deg at 10 deg/s: brings gyro_bias", 3.3, 1.6)]


@pytest.fixture
def record() -> LiveRecord:
    record = LiveRecord(TEST, "out/run", " \N{MIDDLE DOT} ".join(ABOUT))
    record.take(Now(1), True, 2.0)
    return record


@contextmanager
def serving(record: LiveRecord) -> Iterator[Any]:
    made = make_server("127.0.0.1", 0, build(record).server, threaded=True)
    thread = threading.Thread(target=made.serve_forever, daemon=True)
    thread.start()
    yield made
    made.shutdown()
    made.server_close()


@pytest.fixture
def server(record: LiveRecord) -> Iterator[Any]:
    with serving(record) as made:
        yield made


@pytest.fixture(params=["light", "dark"])
def page(request: pytest.FixtureRequest, browser: Any, server: Any) -> Iterator[Any]:
    context = browser.new_context(viewport={"width": 1280, "height": 900}, color_scheme=request.param)
    shown = context.new_page()
    shown.set_default_timeout(180_000)
    complaints: list[str] = []
    shown.on("pageerror", lambda error: complaints.append(str(error)))
    shown.goto(f"http://127.0.0.1:{server.port}/")
    shown.wait_for_selector("tr[data-candidate]")
    yield shown
    context.close()
    assert complaints == []


def columns(page: Any) -> int:
    """Number of stops in the heat map as the browser draws it."""
    return int(page.evaluate("document.querySelector('#heat .js-plotly-plot')?._fullData?.[0]?.x?.length || 0"))


def test_the_maps_grow_and_their_first_channel_is_above(page, record):
    page.wait_for_function("document.querySelector('#heat .js-plotly-plot')?._fullData?.length")
    assert columns(page) == 2
    record.take(Now(3), True, 6.0)
    page.wait_for_function("document.querySelector('#heat .js-plotly-plot')._fullData[0].x.length === 4")
    low, high = page.evaluate("document.querySelector('#heat .js-plotly-plot')._fullLayout.yaxis.range")
    assert low > high
    assert "stop 3 of 3 dwell" in page.inner_text("#place")
    assert "3.3 min Y +90 deg at 10 deg/s: brings gyro_bias" in page.inner_text("#choices")


def test_it_says_beside_the_title_which_test_it_is_and_explains_its_words(page):
    said = page.locator(".bench-bar .about").inner_text()
    assert said.split(" \N{MIDDLE DOT} ") == ABOUT
    assert page.locator("h2 abbr").all_inner_texts() == ["Sigmas", "NIS", "sigma", "one stop left out"]
    assert page.locator("#light abbr", has_text="NIS").get_attribute("title") == WORDS["NIS"]


@pytest.mark.parametrize("width", [800, 1280, 1440])
def test_no_entry_of_the_legend_is_cut(browser, width):
    """The unit of a mass unbalance was: two entries stand beside each other in a narrow column."""
    names = ("gyro_bias_x", "gyro_mass_unbalance_px", "gyro_misalignment_xy")
    effects = ("gyro_bias", "gyro_mass_unbalance", "gyro_misalignment")
    made = LiveRecord(Outline(900.0, 4, effects, dict.fromkeys(names, "deg/h/g")))
    for stop in (1, 2):
        now = Now(stop)
        now.first = dict.fromkeys(names, 1e-5)
        now.sigmas = dict.fromkeys(names, 4.6e-9 / stop)
        made.take(now, True, 2.0)
    with serving(made) as server:
        page = browser.new_page(viewport={"width": width, "height": 900})
        page.goto(f"http://127.0.0.1:{server.port}/")
        page.wait_for_function("document.querySelectorAll('#sigmas .legendtext').length === 3")
        right = "e => e.getBoundingClientRect().right"
        # The last column ends at the frame, which cuts what is beyond it.
        frame = page.locator("#sigmas .legend .bg").evaluate(right)
        ends = page.locator("#sigmas .legendtext").evaluate_all(f"all => all.map({right})")
        starts = page.locator("#sigmas .legendtext").evaluate_all("all => all.map(e => e.getBoundingClientRect().left)")
        page.close()
    assert len({round(start) for start in starts}) >= 2
    assert max(ends) <= frame


def test_a_candidate_that_is_clicked_is_added_and_the_answer_is_shown(page, record):
    page.click(f"tr[data-candidate='{EFFECT}'] button")
    page.wait_for_function(f"document.querySelector('#candidate').textContent.includes('{EFFECT}')")
    page.click("#add")
    page.wait_for_function("document.querySelector('#answer').textContent.includes('asked')")
    asked: list[str] = []
    record.carry_out(lambda effects: asked.extend(effects) or "")
    page.wait_for_function("document.querySelector('#answer').textContent.includes('goes through all samples')")
    now = Now(2)
    now.sigmas[EFFECT] = 1e-5
    record.take(now, True, 3.0)
    page.wait_for_function("document.querySelector('#answer').textContent.includes('is in the model')")
    assert asked == [EFFECT]


def test_the_end_is_told_and_a_server_that_then_goes_is_no_loss(page, record, server):
    record.end(End(True, "The test has ended; results in out/run.", "xdg-open out/run/report.html"))
    page.wait_for_function("document.querySelector('#ended').classList.contains('good')")
    assert "xdg-open out/run/report.html" in page.inner_text("#ended")
    server.shutdown()
    server.server_close()
    page.wait_for_timeout(6_000)
    assert page.locator("#lost").is_hidden()


def test_a_command_that_is_gone_is_told_with_the_folder(page, server):
    server.shutdown()
    server.server_close()
    page.wait_for_selector("#lost:not([hidden])")
    assert "out/run" in page.inner_text("#lost")


def test_no_rule_of_access_is_broken(page):
    page.wait_for_function("document.querySelector('#sigmas .js-plotly-plot')?._fullData?.length")
    assert broken_rules(page) == []


def test_the_button_says_what_it_does(page):
    words = {"light": "Dark page", "dark": "Light page"}
    theme = page.evaluate("window.sdimuTheme()")
    assert page.inner_text("#theme") == words[theme]
    page.click("#theme")
    other = words["dark" if theme == "light" else "light"]
    page.wait_for_function(f"document.querySelector('#theme').textContent === '{other}'")


@pytest.mark.parametrize("width", [800, 500])
def test_nothing_is_wider_than_a_narrow_window(page, width):
    page.set_viewport_size({"width": width, "height": 900})
    page.wait_for_timeout(1_000)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
