"""Heat maps in Chromium: a number is in its cell, or a sign is, on every width of a window; each row has its name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sdimu_calibration.report import data
from sdimu_calibration.report.design.sheet import document
from sdimu_calibration.report.drawing import html
from sdimu_calibration.report.evidence_figures import deviates, heat_map, heat_maps

from .conftest import crossing_labels

STOPS = 28
"""Stops of the longest plan that the repository holds."""
APART_PX = 3.0
"""Least distance of numbers in neighbouring cells (px): they do not read as one."""

_MAPS = """() => Array.from(document.querySelectorAll('.figure')).map(place => {
    const figure = place.querySelector('.js-plotly-plot'), layout = figure._fullLayout;
    const texts = Array.from(figure.querySelectorAll('.heatmap-label text, .heatmaplayer text'))
        .filter(e => e.textContent.trim());
    return {
        cell: layout.xaxis._length / 28,
        widest: Math.max(0, ...texts.map(e => e.getBoundingClientRect().width)),
        longest: Math.max(0, ...texts.map(e => e.textContent.trim().length)),
        least: Math.min(...texts.map(e => parseFloat(getComputedStyle(e).fontSize)))
    };
})"""
"""Of each map: width of a cell, width and length of its widest number, size of the smallest one (px)."""


@pytest.fixture
def maps(tmp_path: Path) -> Path:
    """A page with the two maps of a report that count stops: by channel, and by coefficient."""
    rng = np.random.default_rng(1)
    value = rng.normal(0.0, 2.0, (12, STOPS))
    value[0, 3], value[3, 5] = -25.0, 8.4
    names = [f"gyro_mass_unbalance_d{axis}" for axis in "xyz"]
    figures = (
        heat_map(data.Grid(np.arange(STOPS), value)),
        deviates([str(k) for k in range(STOPS)], names, rng.normal(0.0, 4.0, (3, STOPS)), "stop", "coefficient", 300),
    )
    body = "".join(html(figure, k) for k, figure in enumerate(figures))
    (tmp_path / "maps.html").write_text(document("Maps", body), encoding="utf-8")
    return tmp_path / "maps.html"


@pytest.mark.parametrize("width", [800, 1024, *range(1080, 1321, 40), 1440, 1920, 3840])
def test_no_number_is_wider_than_its_cell(browser: Any, maps: Path, width: int) -> None:
    page = browser.new_page(viewport={"width": width, "height": 900})
    page.goto(maps.as_uri())
    page.evaluate("sdimuDrawAll()")
    found = page.evaluate(_MAPS)
    page.close()
    assert len(found) == 2
    for one in found:
        assert 0.0 < one["widest"] <= one["cell"] - APART_PX, one
        # Where only signs stand, numbers would not have fitted; what is written can be read.
        assert one["longest"] > 1 or one["cell"] < 29.0, one
        assert one["least"] >= 9.5, one


@pytest.mark.parametrize("columns", [40, 56])
def test_what_stands_out_has_its_sign_however_many_stops_there_are(browser: Any, tmp_path: Path, columns: int) -> None:
    """A map of a set of recordings came with signs already, and the page took them for no numbers."""
    value = np.zeros((6, columns))
    value[2, 7], value[5, 30] = 9.0, -4.0
    body = html(heat_map(data.Grid(np.arange(columns), value), tuple("abcdef")), 1)
    (tmp_path / "map.html").write_text(document("Map", body), encoding="utf-8")
    page = browser.new_page(viewport={"width": 1000, "height": 900})
    page.goto((tmp_path / "map.html").as_uri())
    page.evaluate("sdimuDrawAll()")
    found = page.locator(".heatmap-label text, .heatmaplayer text").all_text_contents()
    page.close()
    assert sorted(text for text in found if text.strip()) == ["+", "\N{MINUS SIGN}"]


_LEAST_PX = {1440: 225, 3840: 338}
"""Least height of the map of a first screen (px), by the width of the window: `LEAST` of design/figures.js."""
_LOWEST = """document.addEventListener('DOMContentLoaded', () => {
    const card = document.querySelector('#verdict .card'), map = card.querySelector('.plotly-graph-div');
    const large = window.innerWidth >= 2400 ? 1.5 : 1;
    map.style.height = 330 * large + 'px';
    const free = window.innerHeight - card.getBoundingClientRect().bottom + 330 * large;
    card.style.marginTop = free - 225 * large + 'px';
});"""
"""Puts the card so far down that its map is as low as it may be."""


@pytest.mark.parametrize(("width", "height"), [(1440, 900), (3840, 2160)])
def test_every_row_of_the_lowest_map_of_a_first_screen_has_its_name(
    browser: Any, tmp_path: Path, width: int, height: int
) -> None:
    drawn = heat_maps([data.Grid(np.arange(19), np.ones((12, 19)))])
    body = f'<div id="verdict"><section class="card">{html(drawn, 1)}</section></div>'
    (tmp_path / "map.html").write_text(document("Map", body), encoding="utf-8")
    page = browser.new_page(viewport={"width": width, "height": height})
    page.add_init_script(_LOWEST)
    page.goto((tmp_path / "map.html").as_uri())
    page.wait_for_function("document.querySelector('#verdict .js-plotly-plot .main-svg')")
    shown = page.evaluate("document.querySelector('#verdict .js-plotly-plot')._fullLayout.height")
    names = page.locator("#verdict .ytick text").count()
    crossing = crossing_labels(page)
    page.close()
    assert shown == pytest.approx(_LEAST_PX[width], abs=2)
    assert names == 12
    assert crossing == []
