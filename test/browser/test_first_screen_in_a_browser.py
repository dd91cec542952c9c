"""The first screen of a report of two effects, one of them open: six answers that a reader finds without scrolling."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from sdimu_calibration.core.diagnosis.grades import decimals
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.markup import signs

from .conftest import START_S, sdimu, unfit

CERTAIN, OPEN = "accel_quadratic_z=25 ug/g^2", "gyro_bias_ramp_y=0.1 deg/h/h"
"""Of 23 and 12 sigma; in fifty minutes a ramp of a bias looks like its warm-up."""
SCREENS = ((1440, 900), (800, 1000), (3840, 2160))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of a diagnosis of a recording that is called ``unit_7_monday``."""
    root = tmp_path_factory.mktemp("two")
    hidden = ("--effect", CERTAIN, "--effect", OPEN, "--seed", 11, "--rate", 20)
    for command in (
        ("simulate", "--plan", "kim18_signed", *hidden, "--out", "unit_7_monday"),
        ("diagnose", "unit_7_monday", "--out", "found"),
    ):
        # Beside the recording, as a person works: whole paths make the commands of the page long.
        done = subprocess.run(sdimu(*command), check=False, capture_output=True, text=True, timeout=START_S, cwd=root)
        assert done.returncode == 0, done.stderr
    return root / "found"


@pytest.fixture(params=SCREENS, ids=str)
def page(request: pytest.FixtureRequest, browser: Any, folder: Path) -> Iterator[Any]:
    width, height = request.param
    shown = browser.new_page(viewport={"width": width, "height": height})
    shown.goto((folder / "report.html").as_uri())
    shown.wait_for_function("document.querySelector('#verdict .js-plotly-plot .main-svg')")
    yield shown
    shown.close()


def seen(page: Any, where: str) -> str:
    """Text of a part, which must lie in the window as it is opened."""
    part = page.locator(where).first
    assert part.evaluate("e => e.getBoundingClientRect().bottom") <= page.viewport_size["height"], where
    return " ".join(str(part.inner_text()).split())


def test_a_reader_finds_each_answer_without_scrolling(page: Any, folder: Path) -> None:
    told = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    # Is my model right?
    assert seen(page, "#verdict .tag") == "Something is missing in the model"
    # What is certain, and what is not: a line each, the sentence of the shell together.
    lines = page.locator("#verdict .grade").all_inner_texts()
    assert [line.partition(":")[0] for line in lines] == ["Certain", "Certain, but open which"]
    assert " ".join(lines) == signs(told["sentence"])
    assert seen(page, "#verdict .grade:last-child").endswith("%.")
    # What do I do? What is certain goes into the model, what is open does not yet.
    first = seen(page, "#verdict ol li:first-child")
    assert "accel_quadratic_z" in first
    assert "gyro_bias" not in first
    assert "sdimu calibrate" in first
    # How big is accel_bias_z? As its result has it, beside the error that it has without what was found.
    (one,) = (c for c in result["coefficients"] if c["name"] == "accel_bias_z")
    value, sigma = from_si(one["value"], "ug"), from_si(one["sigma"], "ug")
    shown = f"{value:.{decimals(sigma)}f} \N{PLUS-MINUS SIGN} {sigma:.{decimals(sigma)}f}"
    assert shown in seen(page, "#verdict tr:has-text('accel_bias_z')")
    # Of which models the sigma is.
    assert "over all models" in seen(page, "#verdict .columns .quiet:has-text('one sigma')")
    # Which recording?
    assert "unit_7_monday" in seen(page, ".bar .about")


def test_nothing_on_it_runs_out_of_its_place(page: Any) -> None:
    cut = (
        "Array.from(document.querySelectorAll('#verdict .wide')).filter(e => e.scrollWidth > e.clientWidth + 1).length"
    )
    assert page.evaluate(cut) == 0
    assert [one for one in unfit(page) if one.startswith("wider")] == []


def test_on_a_usual_screen_the_whole_map_is_seen_too(page: Any) -> None:
    if page.viewport_size["width"] == 800:
        assert page.locator("#verdict .pictures .card").last.evaluate("e => e.getBoundingClientRect().top") < 1400
    else:
        seen(page, "#verdict .pictures .card:last-child .quiet")
