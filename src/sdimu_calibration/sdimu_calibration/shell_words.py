"""How the command line says what messages of the core ask for."""

from __future__ import annotations

_VERBS = {"cut": "bag cut"}
"""Verbs that are called otherwise than the work that they do."""


def option(name: str) -> str:
    """Return an option of a verb, from the name of its parameter."""
    return f"--{name.replace('_', '-')}"


def work(name: str) -> str:
    """Return the command that starts a work."""
    return f"sdimu {_VERBS.get(name, name)}"
