"""What to do next, as data: words and commands are made of it outside the core (`storage.files.advice_words`)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum, auto
from typing import Any


class Verb(StrEnum):
    """Work that can be done at once with what is there; `Advice.about` says with what."""

    ADD = auto()
    """Calibrate again with effects added: their keys."""
    DIAGNOSE = auto()
    """Diagnose the recording: its name, where it is known."""
    REVERSE_PLAN = auto()
    """Put the stops of the plan that was driven into another order."""
    RANK_TURNS = auto()
    """Rank all turns by how well they tell effects from each other: the labels of these."""
    CUT = auto()
    """Part the recording: the end of its first part and the begin of the second (s after the first sample)."""
    LEAVE_OUT = auto()
    """Diagnose the recording without a span of time, such as ``66.5-66.8`` (s after the first sample)."""
    CONTINUE = auto()
    """Search a plan that begins with what is known of the unit."""


class Kind(StrEnum):
    """What is advised; behind each stand its arguments."""

    MEND_RECORDING = auto()
    """What is wrong with it."""
    PART_RECORDING = auto()
    """What is wrong at the gap at which it is to be parted."""
    LEAVE_OUT_TIMES = auto()
    """What is wrong in the times that are to be left out."""
    LOOK_FIRST = auto()
    """What is wrong, and no fault of the samples."""
    REPEAT_STOPS = auto()
    OTHER_GRADE = auto()
    """What the rests show beside what the file states, and which file fits."""
    CORRECT_NOISE = auto()
    """Ratios of measured to specified noise: gyro, accelerometer (1)."""
    UNKNOWN_CAUSE = auto()
    """Stop and channel where it acts most, None where none does; whether noise took it in."""
    RECORD_MORE = auto()
    RUN_BACKWARDS = auto()
    RECORD_IN_OTHER_ORDER = auto()
    TRY_EQUATION = auto()
    """Labels of what fits best."""
    KEEP = auto()
    """Label, None for several."""
    TRY = auto()
    """Label of what is likely and not certain, None for several."""
    CORRECT_LATITUDE = auto()
    """Angle that the latitude of the site is too far North, and its sigma (rad)."""
    RECORD_AGAIN = auto()
    """Label."""
    TELL_APART = auto()
    """Pairs of a label and what looks the same; an advice: what to do."""
    RANK_TURNS = auto()
    CHOICE_MATTERS = auto()
    """Label; (other, coefficient, sigmas) of what hangs on the choice."""
    CHOICE_MATTERS_HANDHELD = auto()
    """Label; other, coefficient, sigmas."""
    SIGNED_TURNS = auto()
    """What all turns are, in words."""
    TWO_RATES = auto()
    """Likewise."""

    # What to do to tell an effect from what looks the same: minutes of the turns and stops, where it has some.
    STAY_AND_RETURN = auto()
    """Minutes at the last stop; minutes of the first one again."""
    REPEAT_TURN = auto()
    COME_BACK = auto()
    TURN_BOTH_WAYS = auto()
    REST_BETWEEN = auto()

    # What all data of a unit leave open.
    NO_PLAN_TELLS = auto()
    """Label, and what no plan tells it from."""
    RECORD_ONCE_MORE = auto()
    """Label; what looks the same; length of the rests (s); turns in words."""
    NO_TURN_TELLS = auto()
    """Label; what looks the same; significance of the best turn, and that which tells (sigma)."""
    PLAN_NEXT = auto()

    # About sets.
    REVERSE_AND_ADD = auto()
    TRY_FORCE_EQUATION = auto()
    BEGIN_LATER = auto()
    SOAK_MORE = auto()
    LOOK_AT_MOUNT = auto()
    LOOK_AT_RECORDING = auto()
    """Recording; label of what it alone shows."""
    LOOK_AT_SITE = auto()
    """Recording; by what all its accelerometers' scale factors differ, with its sigma and unit."""
    RECORD_A_THIRD = auto()
    """Label of the coefficient that changed; the two recordings."""
    ONE_BY_ONE = auto()

    # About a fit.
    FIND_EFFECT = auto()
    FIND_SMALLER = auto()


@dataclass(frozen=True)
class Advice:
    """One thing to do."""

    kind: Kind
    arguments: tuple[Any, ...] = ()
    """As `kind` says."""
    verb: Verb | None = None
    """The work, where it can be done at once."""
    about: tuple[str, ...] = ()
    """What it is done with."""
