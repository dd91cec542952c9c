"""Every page of recordings, light and dark: no rule of access is broken, and no word runs out of its place."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import pytest
from plans import HIDDEN, quick_plan

from sdimu_calibration.storage.files.plan_file import write_plan

from .conftest import DWELL_S, SIZE, START_S, broken_rules, sdimu, unfit

PAGES = {
    "calibrate": ("fit", "report.html"),
    "diagnose": ("found", "report.html"),
    "diagnose two": ("set", "report.html"),
    "diagnose by hand": ("held", "report.html"),
    "predict": ("predicted", "prediction.html"),
    "noise": ("noise", "noise.html"),
}
"""Folder and name of the page of each verb."""


@pytest.fixture(scope="module")
def pages(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:  # noqa: ARG001
    """A page of every kind, in folders below one."""
    root = tmp_path_factory.mktemp("pages")
    plan = root / "quick.yaml"
    write_plan(plan, quick_plan(dwell_s=DWELL_S))
    unit = ("--plan", plan, "--rate", 20, "--unit", 5, "--effect", f"{HIDDEN}={SIZE}", "--serial", "A7")
    one, two, by_hand = (root / name for name in ("one", "two", "by_hand"))
    for command in (
        ("simulate", *unit, "--seed", 1, "--out", one),
        ("simulate", *unit, "--seed", 2, "--out", two),
        ("simulate", "--by-hand", 12, "--seed", 3, "--out", by_hand),
        ("calibrate", one, "--out", root / "fit"),
        ("diagnose", one, "--out", root / "found"),
        ("diagnose", one, two, "--out", root / "set"),
        ("diagnose", by_hand, "--out", root / "held"),
        ("predict", "--plan", plan, "--out", root / "predicted"),
        ("noise", one, "--out", root / "noise"),
    ):
        done = subprocess.run(sdimu(*command), check=False, capture_output=True, text=True, timeout=START_S)
        assert done.returncode in {0, 3}, (command, done.stderr)
    return root


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("kind", PAGES)
def test_no_rule_of_access_is_broken_and_every_word_is_in_its_place(
    browser: Any, pages: Path, kind: str, theme: str
) -> None:
    page = browser.new_page(viewport={"width": 1440, "height": 900}, color_scheme=theme)
    complaints: list[str] = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(pages.joinpath(*PAGES[kind]).as_uri())
    page.evaluate("document.querySelectorAll('details').forEach(d => { d.open = true; })")
    broken = broken_rules(page)
    wide = [one for one in unfit(page) if one.startswith("wider")]
    page.close()
    assert broken == []
    assert wide == []
    assert complaints == []
