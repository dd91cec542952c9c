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
    NOT_TRUSTED = auto()
    """The estimate must not be used as it stands."""
    OTHER_GRADE = auto()
    """The file of the IMU is of one of another grade."""
    INSEPARABLE = auto()
    """Two coefficients are one in a test."""
    JITTER = auto()
    """The stamps jitter or come in bursts, whether the samples are taken as even or not."""


MISFITS = frozenset({Topic.MISFIT, Topic.DIFFERS})
"""Topics that a diagnosis answers."""


class Note(str):
    """A line of which programs ask what it is about; its end may advise a diagnosis."""

    bare: str
    """The line of a fit that was diagnosed: without the end."""
    topic: Topic | None

    def __new__(cls, text: str, topic: Topic | None = None, end: str = "") -> Note:
        """Put the text and its end together."""
        made = super().__new__(cls, text + end)
        made.bare, made.topic = text, topic
        return made


def topic_of(line: str) -> Topic | None:
    """Say what a line is about; None for one of which no program asks."""
    return line.topic if isinstance(line, Note) else None


def prefixed(name: str, line: str) -> str:
    """Put a name before a line, which stays about what it is about."""
    told = f"{name}: {line}"
    return Note(told, line.topic) if isinstance(line, Note) else told


def without_advice(notes: Iterable[str]) -> tuple[str, ...]:
    """Return the notes of a fit that was diagnosed: without the advice to diagnose it."""
    return tuple(note.bare if isinstance(note, Note) else note for note in notes)
