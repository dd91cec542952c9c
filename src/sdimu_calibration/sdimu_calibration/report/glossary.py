"""Words that a page uses without saying what they mean, each explained under the mouse and to a screen reader."""

from __future__ import annotations

import re
from html import escape

WORDS = {
    "held-out error": (
        "RMS of measurement minus prediction over its sigma, at stops that the fit did not see. 1: the model is right "
        "to its noise; more: something is missing"
    ),
    "NIS": "mean of the squared difference of measurement and prediction over its variance; 1 is right",
    "sigmas": "standard deviations: of a right model two of three values are within one, 99.7 % within three",
    "without aid": "navigation by this IMU alone after levelling at rest: nothing from outside tells where it is",
}
"""Explanation of each word, in one sentence."""
_ANY = re.compile(rf"(?<![\w-])({'|'.join(map(re.escape, WORDS))})(?![\w-])", re.IGNORECASE)
_KEYS = {word.lower(): text for word, text in WORDS.items()}


def explained(html: str) -> str:
    """Explain each word of the glossary where it stands first; tags and their attributes stay as they are.

    `html`: a part of a page.
    """
    seen: set[str] = set()

    def explain(match: re.Match[str]) -> str:
        word = match[1].lower()
        if word in seen:
            return match[0]
        seen.add(word)
        return f'<abbr title="{escape(_KEYS[word])}">{match[0]}</abbr>'

    parts = re.split(r"(<[^>]*>)", html)
    return "".join(part if part.startswith("<") else _ANY.sub(explain, part) for part in parts)
