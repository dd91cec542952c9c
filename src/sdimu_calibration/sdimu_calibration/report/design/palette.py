"""Tokens of the look: colours by what they mean, in light and dark; pages, figures and pictures take them from here.

Colours are chosen for people who do not tell red from green (Okabe & Ito 2008; P. Tol 2021; RdBu of C. Brewer), and
never stand alone: a sign, a shape or a word says the same. Text and marks keep the contrasts of WCAG 2.2 AA (4.5, 3).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

LIGHT, DARK = "light", "dark"
THEMES = (LIGHT, DARK)
ROLE = "@"
"""First character of a colour that is a meaning: ``@before`` is resolved when the theme is known."""

_COLOURS = {
    # of pages
    "page": ("#f6f7f9", "#101418"),
    "card": ("#ffffff", "#181d23"),
    "sunken": ("#eef0f3", "#20262e"),
    "line": ("#d5d9df", "#333b45"),
    "ink": ("#1b2026", "#e6e9ed"),
    "muted": ("#545d68", "#a9b2bd"),
    "link": ("#0b57a0", "#7fb8f5"),
    "focus": ("#0b57a0", "#f2c14e"),
    # what a state means
    "good": ("#00664f", "#4cc9a6"),
    "doubtful": ("#855700", "#f0b849"),
    "bad": ("#a83232", "#ff8f80"),
    "neutral": ("#545d68", "#a9b2bd"),
    "good_pale": ("#e3f4ee", "#12332b"),
    "doubtful_pale": ("#fdf2d8", "#3a2d10"),
    "bad_pale": ("#fce8e6", "#43201d"),
    # what is drawn
    "before": ("#b45309", "#f5a04c"),
    "after": ("#0b5394", "#74b3f2"),
    "gyro": ("#00677f", "#5cc8dd"),
    "accel": ("#7b3a8c", "#d59ae4"),
    "x": ("#b03a4e", "#f59aa6"),
    "y": ("#1a7334", "#77cf8a"),
    "z": ("#3b329c", "#a9a3ff"),
    "band": ("rgba(27, 32, 38, 0.10)", "rgba(230, 233, 237, 0.14)"),
    "pale": ("rgba(84, 93, 104, 0.50)", "rgba(169, 178, 189, 0.45)"),
    "before_pale": ("rgba(180, 83, 9, 0.55)", "rgba(245, 160, 76, 0.55)"),
    "grid": ("#e3e6ea", "#2b323b"),
    # signed values: negative, a little, nothing, a little, positive
    "minus2": ("#2166ac", "#4393d8"),
    "minus1": ("#92c5de", "#24527c"),
    "zero": ("#ffffff", "#181d23"),
    "plus1": ("#f4a582", "#7d3a2c"),
    "plus2": ("#b2182b", "#e8695a"),
}
"""Colour of each meaning in light and in dark."""

DIVERGING = tuple(
    zip(
        (0.0, 0.25, 0.5, 0.75, 1.0),
        (f"{ROLE}{name}" for name in ("minus2", "minus1", "zero", "plus1", "plus2")),
        strict=True,
    )
)
"""Scale of signed values as roles; also tells signs to those who do not see red and green."""
SERIES = ("@x", "@y", "@z", "@gyro", "@accel", "@doubtful")
"""Curves of one panel; each has a dash or a mark of its own besides."""


def palette(theme: str) -> dict[str, str]:
    """Colour of every meaning in a theme."""
    place = THEMES.index(theme)
    return {name: colours[place] for name, colours in _COLOURS.items()}


def paint(content: Any, theme: str) -> Any:
    """Return a copy of (nested) figure content whose roles are the colours of a theme."""
    return _painted(content, palette(theme))


def _painted(content: Any, colours: Mapping[str, str]) -> Any:
    if isinstance(content, str):
        return colours.get(content[1:], content) if content.startswith(ROLE) else content
    if isinstance(content, Mapping):
        return {key: _painted(value, colours) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [_painted(value, colours) for value in content]
    return content
