"""The report in Chromium: it opens without complaint, light and dark, on a screen and on paper."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.summary import summarise
from sdimu_calibration.report.page import write_report
from sdimu_calibration.report.report_extras import ReportExtras


@pytest.fixture(scope="module")
def report(diagnosis: Diagnosis, more: ReportExtras, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(path, diagnosis.after, summary=summarise(diagnosis), more=more)
    return path


@pytest.fixture(params=["light", "dark"])
def opened(request: pytest.FixtureRequest, browser: Any, report: Path) -> Iterator[Any]:
    """The page in a theme; whatever the console complains about fails the test."""
    page = browser.new_page(viewport={"width": 1440, "height": 900}, color_scheme=request.param)
    faults: list[str] = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("console", lambda message: faults.append(message.text) if message.type in {"error", "warning"} else None)
    page.goto(report.as_uri())
    yield page
    page.close()
    assert faults == []


def test_every_figure_is_drawn(opened: Any) -> None:
    opened.evaluate("sdimuDrawAll()")
    assert opened.locator(".figure").count() > 8
    assert opened.locator(".figure .main-svg").count() >= opened.locator(".figure").count()


def test_the_switch_changes_pages_and_figures_and_is_kept(opened: Any) -> None:
    opened.evaluate("sdimuDrawAll()")
    ink = "() => getComputedStyle(document.querySelector('.figure .xtitle')).fill"
    ground = "() => getComputedStyle(document.body).backgroundColor"
    before = opened.evaluate(ink), opened.evaluate(ground)
    opened.locator("[data-switch-theme]").click()
    after = opened.evaluate(ink), opened.evaluate(ground)
    assert before[0] != after[0]
    assert before[1] != after[1]
    opened.reload()
    assert opened.evaluate(ground) == after[1]
