"""The verdicts of a diagnosis: words that programs read, in files and on topics."""

from __future__ import annotations

from enum import StrEnum


class Verdict(StrEnum):
    """What a diagnosis ends with; a member is its word."""

    CONSISTENT = "consistent"
    NOISE_MODEL_WRONG = "noise model wrong"
    ONE_EFFECT = "one effect"
    CLASS_OF_EFFECTS = "class of effects"
    SEVERAL_EFFECTS = "several effects"
    OWN_EQUATION = "own equation"
    UNEXPLAINED = "unexplained"
    DATA_FAULT = "data fault"
    MISFIT = "misfit"
    """Of a survey in which something stands out."""
    WAITING = "waiting"
    """Of a test that still runs, while there is too little to fit."""
