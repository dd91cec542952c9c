"""How the command line says what messages of the core ask for, and how commands are written to be pasted."""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterable

_VERBS = {"cut": "bag cut"}
"""Verbs that are called otherwise than the work that they do."""


def option(name: str) -> str:
    """Return an option of a verb, from the name of its parameter."""
    return f"--{name.replace('_', '-')}"


def work(name: str) -> str:
    """Return the command that starts a work."""
    return f"sdimu {_VERBS.get(name, name)}"


def joined(words: Iterable[str]) -> str:
    """Write a command on one line that a shell splits into the same words."""
    return " ".join(map(quoted, words))


def quoted(word: str) -> str:
    """Write a word for a shell; one that cannot be shown, as a name that is no text, in escapes of its bytes."""
    if word.isprintable():
        return shlex.quote(word)
    return f"$'{''.join(map(_escaped, word))}'"


def _escaped(character: str) -> str:
    if character in "'\\":
        return f"\\{character}"
    if character.isprintable():
        return character
    return "".join(f"\\x{byte:02x}" for byte in os.fsencode(character))
