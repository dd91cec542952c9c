"""Pieces of HTML of which pages are made."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from html import escape
from typing import Any

Draw = Callable[[Any], str]
"""Makes a part of the page of a figure."""


class Card(str):
    """A section of a page as HTML, of which a table of contents asks what it is called."""

    heading: str
    """As text, not as HTML."""

    def __new__(cls, html: str, heading: str) -> Card:
        """Take the HTML of a section under its heading."""
        made = super().__new__(cls, html)
        made.heading = heading
        return made


def section(heading: str, *parts: str) -> Card:
    """Return a card: a heading with what belongs to it, and an anchor made of the heading."""
    body = "\n".join(part for part in parts if part)
    html = f'<section class="card" id="{anchor(heading)}"><h2>{escape(heading)}</h2>\n{body}</section>'
    return Card(html, heading)


def switched(figure: str, words: Sequence[str]) -> str:
    """Return a figure with a switch for its traces, of which one is shown at a time; of one alone the figure."""
    if len(words) < 2:
        return figure
    buttons = "".join(
        f'<button type="button" data-show="{k}" aria-pressed="{str(not k).lower()}">{escape(word)}</button>'
        for k, word in enumerate(words)
    )
    return f'<div class="switched"><div class="switch" role="group" aria-label="model">{buttons}</div>{figure}</div>'


def folded(heading: str, *parts: str, opened: bool = False) -> str:
    """Return parts that are shown on demand; their figures are drawn when they are unfolded."""
    state = " open" if opened else ""
    return f"<details{state}><summary>{escape(heading)}</summary><div>{''.join(parts)}</div></details>"


def anchor(heading: str) -> str:
    """Name of a place in a page, made of its heading."""
    return "-".join(re.findall(r"[a-z0-9]+", heading.lower()))


def prose(text: str) -> str:
    """Return text for a page; what a terminal writes with two characters gets its own sign."""
    return escape(text.replace(" -> ", " \N{RIGHTWARDS ARROW} ").replace(" +- ", " \N{PLUS-MINUS SIGN} "))


def signs(text: str) -> str:
    """Return a sentence of a diagnosis with the signs of print for what a terminal writes with its own.

    No line ends between a number and its sigma or its per cent.
    """
    together = text.replace(" +- ", "\u00a0\N{PLUS-MINUS SIGN}\u00a0").replace(" %", "\u00a0%")
    return _MINUS.sub("\N{MINUS SIGN}", together)


_MINUS = re.compile(r"(?<![^\s(])-(?=\.?\d)")
"""A hyphen that begins a number: not one of a range, a date, an exponent or a name."""


def quiet(text: str) -> str:
    """Return a remark."""
    return f'<p class="quiet">{prose(text)}</p>'


def sentence(text: str) -> str:
    """Return a paragraph."""
    return f"<p>{prose(text)}</p>"


def grid(columns: Sequence[str], rows: Sequence[Sequence[str]], text: set[int]) -> str:
    """Return an HTML table; the columns in `text` are flush left, the others are numbers with the signs of print."""

    def cell(tag: str, k: int, word: str) -> str:
        return f'<{tag} class="text">{escape(word)}</{tag}>' if k in text else f"<{tag}>{escape(signs(word))}</{tag}>"

    def line(tag: str, words: Sequence[str]) -> str:
        return f"<tr>{''.join(cell(tag, k, word) for k, word in enumerate(words))}</tr>"

    body = "".join(line("td", row) for row in rows)
    return f'<div class="wide"><table><thead>{line("th", columns)}</thead><tbody>{body}</tbody></table></div>'
