"""The page of the workbench: its figures and their axes, windows of other sizes, keys, and rules of access."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Callable
from typing import Any

import pytest
from plans import HIDDEN

from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.cost import metres
from sdimu_calibration.report.table import with_sigma

from .bench_page import add_first, choose, click_cell, drawn, held_out, text
from .conftest import DWELL_S, START_S, WIDE_4K, Workbench, click_bar, sdimu, settle, unfit


def test_a_click_on_a_cell_shows_that_stop_and_channel(visit: Callable[[], Any]) -> None:
    page = visit()
    click_cell(page, "accel x", "7")
    page.locator("#residuals .gtitle", has_text="accel x at stop 7").wait_for()
    settle(page)


def test_stops_held_out_are_predicted(visit: Callable[[], Any]) -> None:
    page = visit()
    choose(page, "held", "stop 5")
    page.locator("#hold").click()
    page.locator("#numbers", has_text="of what is left out").wait_for()
    settle(page)
    assert "5" not in drawn(page, "heat", "x")


def test_a_coefficient_is_edited_in_its_row_beside_the_heat_map(visit: Callable[[], Any]) -> None:
    page = visit()
    drawer = page.locator("#drawer")
    assert drawer.is_hidden()
    page.keyboard.press("c")
    row = page.locator("tr[data-coefficient=accel_bias_y]")
    row.locator("button").click()
    page.wait_for_function("document.getElementById('mean').value.endsWith(' ug')")
    inside, place = row.bounding_box(), page.locator("#editor").bounding_box()
    assert inside["y"] < place["y"]
    assert place["y"] + place["height"] <= inside["y"] + inside["height"] + 1.0
    assert page.locator("#heat").bounding_box()["y"] < drawer.bounding_box()["y"]  # the map is still seen
    page.locator("#mean").fill("110 ug")
    page.locator("#sigma").fill("5")
    page.locator("#sigma").press("Enter")
    # Other rows keep the prior of the IMU's file.
    row.filter(has_text="free, own prior").wait_for()
    settle(page)
    assert "110 \N{PLUS-MINUS SIGN} 5" in row.inner_text()
    # The table is another one: its row is open again, with the controls in it.
    inside, place = row.bounding_box(), page.locator("#editor").bounding_box()
    assert place["y"] + place["height"] <= inside["y"] + inside["height"] + 1.0
    page.keyboard.press("Escape")
    drawer.wait_for(state="hidden")


def test_in_a_narrow_window_the_candidate_stands_beside_the_map_and_numbers_only_where_they_fit(
    visit: Callable[[], Any],
) -> None:
    page = visit()
    written = (
        "document.querySelector('#heat .js-plotly-plot')._fullData[0].text.flat().filter(t => /[0-9]/.test(t)).length"
    )
    assert page.evaluate(written) > 100
    page.set_viewport_size({"width": 800, "height": 1000})
    page.wait_for_function(f"{written} === 0")
    settle(page)
    page.keyboard.press("j")
    page.locator("#candidate-name").wait_for()
    settle(page)
    heat, candidate = page.locator("#heat").bounding_box(), page.locator("#preview").bounding_box()
    assert candidate["x"] >= heat["x"] + heat["width"]
    assert heat["y"] - 150 < candidate["y"] < heat["y"] + heat["height"] / 2


def test_every_axis_says_its_unit(visit: Callable[[], Any]) -> None:
    page = visit()
    for name in ("heat", "residuals", "ladder", "ranking"):
        titles = page.evaluate(
            "name => { const l = document.querySelector(`#${name} .js-plotly-plot`)._fullLayout;"
            " return [l.xaxis, l.yaxis].map(a => [a.type, a.title?.text ?? '']); }",
            name,
        )
        for kind, title in titles:
            # Names on an axis have no unit, but say what they are names of.
            assert re.search(r"\w" if kind == "category" else r"\(.+\)$", title), (name, title)


def test_ranking_heat_map_residuals_and_ladder_stand_in_one_view(visit: Callable[[], Any]) -> None:
    page = visit()
    page.set_viewport_size({"width": 1440, "height": 900})
    inside = (
        "(height) => ['heat', 'residuals', 'ladder', 'ranking', 'verdict', 'add'].every(name => {"
        " const box = document.getElementById(name).getBoundingClientRect();"
        " return box.height > 0 && box.top >= 0 && box.bottom <= height; })"
    )
    # Figures are drawn anew after the window has its size: what is asked must hold when nothing moves any more.
    page.wait_for_function(inside, arg=900)
    settle(page)
    assert page.evaluate(inside, 900)
    for width in (800, 390):
        page.set_viewport_size({"width": width, "height": 1000})
        page.wait_for_function("width => document.documentElement.scrollWidth <= width", arg=width)
        settle(page)
        assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_on_a_screen_of_4k_every_word_is_read_and_in_its_place(visit: Callable[[], Any]) -> None:
    page = visit()
    page.set_viewport_size(WIDE_4K)
    # Figures are drawn anew by the server, which knows the new size a moment later.
    larger = "name => parseFloat(getComputedStyle(document.querySelector(`#${name} .xtitle`)).fontSize) > 16"
    for name in ("heat", "ranking", "residuals", "ladder"):
        page.wait_for_function(larger, arg=name)
    # A key that is pressed while candidates are looked for is lost.
    settle(page)
    page.keyboard.press("j")
    page.locator("#candidate-name").wait_for()
    settle(page)
    assert unfit(page) == []


@pytest.fixture(scope="module")
def told(workbench: Workbench, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the shell says of the recording."""
    out = tmp_path_factory.mktemp("told")
    command = sdimu("diagnose", workbench.bag, "--out", out)
    subprocess.run(command, check=True, capture_output=True, timeout=START_S)
    return dict(json.loads((out / "diagnosis.json").read_text(encoding="utf-8")))


def test_each_model_of_the_ladder_has_the_metres_of_the_shell(visit: Callable[[], Any], told: dict[str, Any]) -> None:
    shell = {one["model"]: metres(one["rms_m"]) for one in told["in_use"]["position"]}
    page = visit()
    page.locator("#in-use", has_text="without aid").wait_for()
    said = text(page, "in-use")
    assert said.startswith(" \N{RIGHTWARDS ARROW} ".join(f"{far} ({model})" for model, far in shell.items()))
    assert [words.partition(", ")[2] for words in drawn(page, "ladder", "text")] == [shell["model as given"]]
    add_first(page)
    page.locator("#verdict", has_text="\N{CHECK MARK}").wait_for()
    page.wait_for_function(
        "() => { const t = document.querySelector('#ladder .js-plotly-plot')._fullData[0].text;"
        " return t.length === 2 && Array.from(t).every(words => words.endsWith(' m')); }"
    )
    settle(page)
    worth = [words.partition(", ")[2] for words in drawn(page, "ladder", "text")]
    assert worth == [shell["model as given"], shell["with what was found"]]


def test_a_click_on_a_candidate_shows_the_numbers_of_the_shell(visit: Callable[[], Any], told: dict[str, Any]) -> None:
    (step,) = told["ladder"]
    (found,) = told["candidates"]
    page = visit()
    click_bar(page, 0)
    page.locator("#candidate-name").wait_for()
    settle(page)
    said = text(page, "preview")
    unit = found["parameters"][0]["display_unit"]
    estimate, sigma = (from_si(step[key], unit) for key in ("estimate", "sigma"))
    assert f"{step['label']}: {with_sigma(estimate, sigma, unit)}, {step['z']:+.1f} sigma" in said
    errors = (f"{step[f'one_stop_out_{when}']:.3f}" for when in ("before", "after"))
    assert " \N{RIGHTWARDS ARROW} ".join(errors) in said
    sentence = text(page, "verdict").replace("\N{NO-BREAK SPACE}", " ").replace("\N{PLUS-MINUS SIGN}", "+-")
    assert told["sentence"] in sentence


def test_a_candidate_is_drawn_over_the_residuals_before_it_is_added(visit: Callable[[], Any]) -> None:
    page = visit()
    click_bar(page, 0)
    page.locator("#candidate-name").wait_for()
    said = text(page, "preview")
    assert "df_i = K2_i a_i^2" in said
    words = r"Error with one stop left out ([\d.]+) \N{RIGHTWARDS ARROW} ([\d.]+)"
    before, after = map(float, re.search(words, said).groups())
    assert before == held_out(page)
    page.locator("#residuals .legendtext", has_text=f"{HIDDEN} would take").wait_for()
    page.locator("#add").click()
    page.locator("#numbers", has_text="\N{RIGHTWARDS ARROW}").wait_for()
    settle(page)
    # The linear model told it before.
    assert held_out(page) == pytest.approx(after, abs=0.01)


def test_the_card_that_was_clicked_says_what_is_done_for_it(visit: Callable[[], Any]) -> None:
    page = visit()
    told = (
        "() => Array.from(document.querySelectorAll('.card[data-working]'),"
        " card => card.contains(document.getElementById('add')))"
    )
    assert page.evaluate(told) == []
    add_first(page)
    page.wait_for_function(f"JSON.stringify(({told})()) === '[true]'")
    settle(page)
    page.wait_for_function(f"({told})().length === 0")


def test_before_and_after_are_shown_by_a_key_on_the_same_cells(visit: Callable[[], Any]) -> None:
    page = visit()
    given = drawn(page, "heat", "z.map(r => Array.from(r))")
    add_first(page)
    page.locator("#verdict", has_text="\N{CHECK MARK}").wait_for()
    settle(page)
    now = drawn(page, "heat", "z.map(r => Array.from(r))")
    assert now != given
    page.locator("h1").click()
    page.keyboard.press("b")
    page.keyboard.press("b")
    page.wait_for_function("document.querySelector('#shows input').checked")
    settle(page)
    page.wait_for_function(
        "given => JSON.stringify(Array.from(document.querySelector('#heat .js-plotly-plot')._fullData[0]"
        ".z.map(r => Array.from(r)))) === JSON.stringify(given)",
        arg=given,
    )
    assert drawn(page, "heat", "x") == [str(stop) for stop in range(19)]


def test_undo_redo_and_help_by_keyboard(visit: Callable[[], Any]) -> None:
    page = visit()
    page.keyboard.press("j")
    page.locator("#candidate-name").wait_for()
    page.keyboard.press("a")
    page.locator("#verdict", has_text="\N{CHECK MARK}").wait_for()
    settle(page)
    page.keyboard.press("Control+z")
    page.locator("#verdict", has_text="\N{WARNING SIGN}").wait_for()
    settle(page)
    page.keyboard.press("Control+y")
    page.locator("#verdict", has_text="\N{CHECK MARK}").wait_for()
    settle(page)
    page.keyboard.press("?")
    page.locator("#help", has_text="Ctrl+Z").wait_for()
    page.keyboard.press("Escape")
    page.locator("#help").wait_for(state="hidden")
    # Letters that are written into a field are no keys.
    page.locator("#own").click()
    page.keyboard.type("u")
    page.wait_for_timeout(500)
    assert text(page, "verdict").startswith("\N{CHECK MARK}")


def test_residuals_are_drawn_against_what_is_chosen(visit: Callable[[], Any]) -> None:
    page = visit()
    page.get_by_text("all", exact=True).click()
    choose(page, "against", "roll (deg)")
    page.wait_for_function(
        "document.querySelector('#residuals .js-plotly-plot')._fullLayout.xaxis.title.text === 'roll (deg)'"
    )
    settle(page)
    roll = drawn(page, "residuals", "x")
    # More than ten of the nineteen stops have.
    assert len(roll) > 10 * DWELL_S
    assert max(map(abs, roll)) <= 180.0


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_the_page_breaks_no_serious_rule_of_access(visit: Callable[[], Any], theme: str) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="no axe-core here (make setup)")
    page = visit()
    page.emulate_media(color_scheme=theme)
    page.keyboard.press("j")
    page.locator("#candidate-name").wait_for()
    settle(page)
    found = axe.Axe().run(page).response["violations"]
    assert [(rule["id"], rule["nodes"][0]["html"]) for rule in found if rule["impact"] in {"serious", "critical"}] == []


@pytest.mark.parametrize("width", [1280, 1440])
def test_numbers_stand_in_the_cells_only_where_they_fit(visit: Callable[[], Any], width: int) -> None:
    page = visit()
    page.set_viewport_size({"width": width, "height": 900})
    page.wait_for_timeout(600)
    room, need = page.evaluate(
        "() => { const c = document.createElement('canvas').getContext('2d');"
        "c.font = '10px ' + getComputedStyle(document.querySelector('#heat text')).fontFamily;"
        "const map = document.querySelector('#heat .js-plotly-plot')._fullLayout.xaxis._length;"
        "return [map / benchLook().stops, c.measureText('+2.1').width]; }"
    )
    assert room > need + 1
