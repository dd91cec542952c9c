"""Advice as HTML: commands that can be pasted, minutes that stand out."""

from __future__ import annotations

import re
from collections.abc import Callable
from html import escape

from sdimu_calibration.report.markup import prose

_COMMAND = re.compile(r"(sdimu [a-z-]+(?: --?[\w-]+(?: [A-Z]+\b| '[^']*')?)*|--\w+ '[^']*'(?: --\w+ '[^']*')*)")
_MINUTES = re.compile(r"\((\d+ min)[^)]*\)")
Spell = Callable[[str], tuple[str, str]]
"""Parts an advice into words and the whole command that it means; an empty command where it names none."""


def advice_html(text: str, spell: Spell | None) -> str:
    """Return an advice as HTML; `spell` makes a whole command of what it names."""
    words, command = (text, "") if spell is None else spell(text)
    if command:
        # A browser breaks a line after a hyphen: a word of a command stays whole.
        whole = " ".join(f"<span>{escape(word)}</span>" for word in command.split(" "))
        return f'{advice_html(words, None)} <code class="command">{whole}</code>'
    return _MINUTES.sub(r"<strong>(\1)</strong>", _COMMAND.sub(r"<code>\1</code>", prose(text).replace("&#x27;", "'")))
