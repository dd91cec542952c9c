"""A line for people about a fit, which also says to programs what it is about."""

from __future__ import annotations

from enum import StrEnum, auto


class Topic(StrEnum):
    """What a line is about, where programs ask."""

    NOT_TRUSTED = auto()
    """The estimate must not be used as it stands."""
    MISFIT = auto()
    """The model does not fit."""
    DIFFERS = auto()
    """A coefficient is not the same in all recordings of a set."""
    INSEPARABLE = auto()
    """Two coefficients are one in this test."""


class Note(str):
    """A line; where its `ending` advises a diagnosis, `bare` is the line of a fit that was diagnosed.

    Attributes
    ----------
    bare : str
        Without the ending.
    topic : Topic or None
    """

    bare: str
    topic: Topic | None

    def __new__(cls, text: str, topic: Topic | None = None, ending: str = "") -> Note:
        """Put text and ending together."""
        made = super().__new__(cls, text + ending)
        made.bare, made.topic = text, topic
        return made


def topic_of(line: str) -> Topic | None:
    """Say what a line is about; None for one of which nobody asks."""
    return line.topic if isinstance(line, Note) else None
