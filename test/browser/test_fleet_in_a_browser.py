"""Pages of many results, in Chromium: they draw without errors, the table sorts, the certificate fits on A4."""

from __future__ import annotations

import re
from typing import Any

import pytest
import typer

from sdimu_calibration.cli.datasheet import datasheet
from sdimu_calibration.cli.fleet import fleet

from .conftest import WIDE_4K, broken_rules, crossing_labels, unfit

SHEET_PX = 703
"""Width of A4 less the margins of the pages (186 mm) at 96 dots an inch."""


@pytest.fixture
def opened(browser: Any) -> Any:
    page = browser.new_page(viewport={"width": 1300, "height": 1000})
    page.faults = []
    page.on("pageerror", lambda error: page.faults.append(str(error)))
    page.on("console", lambda message: page.faults.append(message.text) if message.type == "error" else None)
    yield page
    page.close()


def test_the_fleet_draws_and_sorts_by_the_heading_that_is_clicked(batch, opened):
    folder = batch(units=6, out=2)
    fleet([folder])
    opened.goto(f"file://{folder / 'fleet.html'}")
    opened.evaluate("sdimuDrawAll()")
    assert opened.locator(".js-plotly-plot").count() >= 5
    # Numbers with a sign of print, too.
    heading = opened.locator("thead th", has_text="mean").first
    heading.click()
    column = opened.evaluate("head => Array.from(head.parentNode.children).indexOf(head)", heading.element_handle())
    table = opened.locator("table").first

    def shown() -> list[float]:
        rows = table.locator("tbody tr")
        texts = [rows.nth(k).locator("td").nth(column).inner_text() for k in range(rows.count())]
        return [float(text.replace("\N{MINUS SIGN}", "-")) for text in texts]

    rising = shown()
    assert rising == sorted(rising)
    assert rising[0] < 0.0 < rising[-1]
    assert heading.get_attribute("aria-sort") == "ascending"
    heading.click()
    assert shown() == rising[::-1]
    assert opened.faults == []


def test_no_label_of_a_narrow_page_crosses_another(batch, opened):
    folder = batch(units=6)
    fleet([folder])
    opened.set_viewport_size({"width": 800, "height": 1000})
    opened.goto(f"file://{folder / 'fleet.html'}")
    opened.evaluate("sdimuDrawAll()")
    assert opened.locator(".js-plotly-plot").count() >= 5
    assert crossing_labels(opened) == []


def test_the_certificate_prints_on_a4_and_nothing_is_cut(batch, opened):
    folder = batch(units=1, each=3)
    datasheet([folder], certificate=True, operator="A. Person")
    opened.set_viewport_size({"width": SHEET_PX, "height": 1000})
    opened.emulate_media(media="print")
    opened.goto(f"file://{folder / 'datasheet.html'}")
    assert opened.evaluate("document.documentElement.scrollWidth") <= SHEET_PX
    paper = opened.pdf(prefer_css_page_size=True)
    sheets = re.findall(rb"/MediaBox\s*\[0 0 ([\d.]+) ([\d.]+)\]", paper)
    assert sheets
    # 210 by 297 mm in points.
    assert all(abs(float(w) - 595.3) < 1.0 and abs(float(h) - 841.9) < 1.0 for w, h in sheets)
    assert opened.faults == []


def test_verdict_and_limits_are_on_the_first_screen_and_nothing_is_wider_than_a_narrow_window(batch, opened, tmp_path):
    folder = batch(units=1, each=3)
    limits = tmp_path / "limits.yaml"
    limits.write_text(
        "format: sdimu-limits/1\nlimits:\n  gyro bias: 100 deg/h\n  gyro angle random walk: 1 deg/sqrt(h)\n"
    )
    with pytest.raises(typer.Exit) as ended:
        datasheet([folder], certificate=True, operator="A. Person", limits=limits)
    assert ended.value.exit_code == 3
    opened.set_viewport_size({"width": 800, "height": 1000})
    opened.goto(f"file://{folder / 'datasheet.html'}")
    assert opened.evaluate("document.documentElement.scrollWidth") <= 800
    told = opened.locator(".verdict li")
    assert told.all_inner_texts()[1].startswith("pass gyro bias")
    assert told.last.evaluate("item => item.getBoundingClientRect().bottom") < 400


def test_on_a_screen_of_4k_every_word_of_a_data_sheet_is_read_and_in_its_place(batch, opened):
    folder = batch(units=1, each=3)
    datasheet([folder], certificate=True, operator="A. Person")
    opened.set_viewport_size(WIDE_4K)
    opened.goto(f"file://{folder / 'datasheet.html'}")
    assert unfit(opened) == []
    assert opened.faults == []


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("kind", ["fleet", "data sheet", "certificate"])
def test_no_rule_of_access_is_broken(batch, opened, kind, theme):
    folder = batch(units=6, out=2) if kind == "fleet" else batch(units=1, each=3)
    if kind == "fleet":
        fleet([folder])
    else:
        datasheet([folder], certificate=kind == "certificate", operator="A. Person" if kind == "certificate" else "")
    opened.emulate_media(color_scheme=theme)
    opened.goto(f"file://{folder / ('fleet.html' if kind == 'fleet' else 'datasheet.html')}")
    opened.evaluate("document.querySelectorAll('details').forEach(d => { d.open = true; })")
    assert broken_rules(opened) == []
