"""Advice as HTML: commands that can be pasted, minutes that stand out."""

from __future__ import annotations

import re
from collections.abc import Callable
from html import escape

from sdimu_calibration.core.advice import Advice
from sdimu_calibration.report.markup import prose
from sdimu_calibration.storage.files.advice_words import lead, sentence

_COMMAND = re.compile(r"(sdimu [a-z-]+(?: --?[\w-]+(?: [A-Z]+\b| '[^']*')?)*|--\w+ '[^']*'(?: --\w+ '[^']*')*)")
_MINUTES = re.compile(r"\((\d+ min)[^)]*\)")
Spell = Callable[[Advice], str]
"""Writes the whole command that an advice means; empty where it means none."""


def advice_html(advice: Advice | str, spell: Spell | None) -> str:
    """Return an advice, or a line that needs no command, as HTML; `spell` makes a whole command of what it means."""
    if isinstance(advice, str):
        return _marked(advice)
    command = "" if spell is None else spell(advice)
    if not command:
        return _marked(sentence(advice))
    # A browser breaks a line after a hyphen: a word of a command stays whole.
    whole = " ".join(f"<span>{escape(word)}</span>" for word in command.split(" "))
    return f'{_marked(f"{lead(advice)}:")} <code class="command">{whole}</code>'


def _marked(text: str) -> str:
    return _MINUTES.sub(r"<strong>(\1)</strong>", _COMMAND.sub(r"<code>\1</code>", prose(text).replace("&#x27;", "'")))
