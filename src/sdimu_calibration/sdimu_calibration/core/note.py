"""A line for people about a fit, which also says to programs what it is about."""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum, auto


class Topic(StrEnum):
    """What a line is about, where programs ask."""

    MISFIT = auto()
    """The model does not fit."""
    DIFFERS = auto()
    """A coefficient is not the same in all recordings of a set."""


class Note(str):
    """A line whose end advises a diagnosis.

    Attributes
    ----------
    bare : str
        The line of a fit that was diagnosed: without the end.
    topic : Topic or None
    """

    bare: str
    topic: Topic | None

    def __new__(cls, text: str, topic: Topic | None = None, end: str = "") -> Note:
        """Put the text and its end together."""
        made = super().__new__(cls, text + end)
        made.bare, made.topic = text, topic
        return made


def topic_of(line: str) -> Topic | None:
    """Say what a line is about; None for one of which no program asks."""
    return line.topic if isinstance(line, Note) else None


def without_advice(notes: Iterable[str]) -> tuple[str, ...]:
    """Return the notes of a fit that was diagnosed: without the advice to diagnose it."""
    return tuple(note.bare if isinstance(note, Note) else note for note in notes)
