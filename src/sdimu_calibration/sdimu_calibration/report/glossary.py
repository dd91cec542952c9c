"""Words that a page uses without saying what they mean, each explained under the mouse and to a screen reader."""

from __future__ import annotations

import re
from collections.abc import Iterator
from html import escape

WORDS = {
    "held-out error": (
        "RMS of measurement minus prediction over its sigma, at stops that the fit did not see. 1: the model is right "
        "to its noise; more: something is missing"
    ),
    "one stop left out": (
        "RMS of measurement minus prediction over its sigma, each stop predicted from all others by the linear model: "
        "quick, and nearer to 1 than with a third of the stops left out, because the turns beside a stop tell of it"
    ),
    "a third of the stops left out": (
        "RMS of measurement minus prediction over its sigma, each third of the stops predicted by a fit to the two "
        "others: the held-out error of a report; it falls more than with one stop left out"
    ),
    "NIS": "mean of the squared difference of measurement and prediction over its variance; 1 is right",
    "sigma": "one standard deviation: of a right model two of three values are within it",
    "sigmas": "standard deviations: of a right model two of three values are within one, 99.7 % within three",
    "without aid": "navigation by this IMU alone after levelling at rest: nothing from outside tells where it is",
}
"""Explanation of each word, in one sentence."""
_ANY = re.compile(rf"(?<![\w-])({'|'.join(map(re.escape, WORDS))})(?![\w-])", re.IGNORECASE)
_KEYS = {word.lower(): text for word, text in WORDS.items()}


def in_parts(text: str, seen: set[str] | None = None) -> Iterator[tuple[str, str]]:
    """Part a text into words of the glossary, each with its explanation, and what stands between, with none.

    `seen`: words that were explained already, and grows; a word is explained where it stands first.
    """
    known, end = set[str]() if seen is None else seen, 0
    for match in _ANY.finditer(text):
        word = match[1].lower()
        if word in known:
            continue
        known.add(word)
        if match.start() > end:
            yield text[end : match.start()], ""
        yield match[0], _KEYS[word]
        end = match.end()
    if end < len(text):
        yield text[end:], ""


def explained(html: str) -> str:
    """Explain each word of the glossary where it stands first; tags and their attributes stay as they are.

    `html`: a part of a page.
    """
    seen: set[str] = set()

    def told(text: str) -> str:
        return "".join(
            f'<abbr title="{escape(why)}">{part}</abbr>' if why else part for part, why in in_parts(text, seen)
        )

    parts = re.split(r"(<[^>]*>)", html)
    return "".join(part if part.startswith("<") else told(part) for part in parts)
