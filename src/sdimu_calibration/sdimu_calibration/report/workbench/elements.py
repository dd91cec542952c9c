"""Elements that pages share: a card with its title, a figure with its words."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from dash import dcc, html

from sdimu_calibration.report.design.library import CONFIG, NEEDLESS
from sdimu_calibration.report.glossary import in_parts


def explained(text: str) -> Any:
    """Return a text of which each word of the glossary is explained under the mouse, as a report does."""
    parts = [html.Abbr(words, title=why) if why else words for words, why in in_parts(text)]
    return text if parts == [text] else parts


def card(title: str, *parts: Any, more: str = "") -> Any:
    """Return a card; `more` are further classes."""
    return html.Section([html.H2(explained(title)), *parts], className=f"card {more}".strip())


def table(headings: Sequence[str], rows: Iterable[Any]) -> Any:
    """Return a table; a row is its texts, or a row of the page already."""
    made = [row if isinstance(row, html.Tr) else html.Tr([html.Td(cell) for cell in row]) for row in rows]
    return html.Table([html.Thead(html.Tr([html.Th(explained(word)) for word in headings])), html.Tbody(made)])


def graph(name: str, words: str) -> Any:
    """Return the place of a figure, with words for those who do not see it."""
    # Plotly's own "responsive" would take the height of the container, which has none; the component follows the width.
    config = {key: value for key, value in CONFIG.items() if key != "responsive"}
    config["modeBarButtonsToRemove"] = list(NEEDLESS)
    return html.Div(dcc.Graph(id=name, config=config), role="group", **{"aria-label": words})
