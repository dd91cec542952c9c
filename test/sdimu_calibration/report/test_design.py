"""The tokens: every colour that carries text or a mark has the contrast that WCAG 2.2 AA asks for, in both themes."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import sdimu_calibration.report as room
from sdimu_calibration.report.design.library import CONFIG
from sdimu_calibration.report.design.palette import THEMES, paint, palette
from sdimu_calibration.report.design.plotly_template import template
from sdimu_calibration.report.design.sheet import STYLE

TEXT, MARK = 4.5, 3.0
"""Least contrast of text and of what is drawn (WCAG 2.2, 1.4.3 and 1.4.11)."""


def luminance(colour: str) -> float:
    """Relative luminance (WCAG 2.2)."""
    parts = [int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: str, other: str) -> float:
    high, low = sorted((luminance(one), luminance(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("theme", THEMES)
def test_text_is_legible_on_every_ground(theme):
    colours = palette(theme)
    for ground in ("page", "card", "sunken"):
        for text in ("ink", "muted", "link", "good", "doubtful", "bad"):
            assert contrast(colours[text], colours[ground]) >= TEXT, (text, ground)
    for state in ("good", "doubtful", "bad"):
        for text in ("ink", "muted", state):
            assert contrast(colours[text], colours[f"{state}_pale"]) >= TEXT, (text, state)


@pytest.mark.parametrize("theme", THEMES)
def test_what_is_drawn_stands_out_of_its_ground(theme):
    colours = palette(theme)
    for mark in ("before", "after", "gyro", "accel", "x", "y", "z", "minus2", "plus2", "focus"):
        assert contrast(colours[mark], colours["card"]) >= MARK, mark


def test_every_role_and_every_property_has_a_colour():
    folder = Path(room.__file__).parent
    sources = "\n".join(path.read_text() for path in folder.rglob("*.py"))
    assert set(re.findall(r'"@(\w+)"', sources)) <= set(palette("light"))
    used, given = set(re.findall(r"var\(--(\w+)", STYLE)), set(re.findall(r"--(\w+):", STYLE))
    assert used <= given


@pytest.mark.parametrize("theme", THEMES)
def test_nothing_that_is_painted_keeps_a_role(theme):
    assert "@" not in str(template(theme))
    assert paint({"color": ["@before", "@not a role", "x"]}, theme)["color"][1:] == ["@not a role", "x"]


def test_no_button_of_a_figure_sends_what_was_measured_to_a_server():
    graph = pytest.importorskip("sdimu_calibration.report.workbench.elements").graph
    assert CONFIG["showSendToCloud"] is False
    assert graph("heat", "words").children.config["showSendToCloud"] is False
