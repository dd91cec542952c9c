"""What a person reads and clicks on the page of the workbench."""

from __future__ import annotations

import re
from typing import Any

from .conftest import click_bar


def text(page: Any, name: str) -> str:
    return str(page.locator(f"#{name}").inner_text())


def drawn(page: Any, name: str, what: str) -> Any:
    """Numbers of a figure as the browser holds them."""
    return page.evaluate(f"Array.from(document.querySelector('#{name} .js-plotly-plot')._fullData[0].{what})")


def held_out(page: Any) -> float:
    """Last error with one stop left out in the line of numbers."""
    return [float(number) for number in re.findall(r"[\d.]+(?= sigma)", text(page, "numbers"))][-1]


def click_cell(page: Any, channel: str, stop: str) -> None:
    at = page.evaluate(
        "([channel, stop]) => { const f = document.querySelector('#heat .js-plotly-plot'), l = f._fullLayout;"
        " return [l.xaxis._offset + l.xaxis.d2p(stop), l.yaxis._offset + l.yaxis.d2p(channel)]; }",
        [channel, stop],
    )
    page.locator("#heat .js-plotly-plot").click(position={"x": at[0], "y": at[1]})


def add_first(page: Any) -> None:
    """Look at the first candidate, then add it."""
    click_bar(page, 0)
    page.locator("#candidate-name").wait_for()
    page.locator("#add").click()


def choose(page: Any, field: str, option: str) -> None:
    page.locator(f"#{field}").click()
    page.locator(".dash-options-list-option-text").get_by_text(option, exact=True).click()
    page.keyboard.press("Escape")


def add_own(page: Any, effect: str) -> None:
    page.locator("#own").fill(effect)
    page.locator("#own").blur()
    page.locator("#add-own").click()
