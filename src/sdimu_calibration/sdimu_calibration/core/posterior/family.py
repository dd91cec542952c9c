"""Families of effects: what one error of one sensor may come from."""

from __future__ import annotations

from sdimu_calibration.core.effects.effect import CHANNELS
from sdimu_calibration.core.evidence.candidate import Candidate

BIAS_DRIFT = "_bias_drift"
"""How the name of a family ends that holds all that changes a bias slowly."""


def family_of(candidate: Candidate) -> tuple[str, str]:
    """Name the family of a candidate, and its sensor.

    Returns
    -------
    family : str
        ``gyro_bias_drift`` for all that changes a bias slowly, cable wrap with it, else the registry name of the
        effect; ``own`` of an equation.
    sensor : str
        Such as ``gyro_y``; the triad where it acts on several axes of one, empty where on both. Behind it the
        recording, where it acts in one of a set alone.
    """
    effect = candidate.effect
    channels = sorted({term.channel for term in effect.terms})
    triads = {CHANNELS[c].partition("_")[0] for c in channels}
    sensor = CHANNELS[channels[0]] if len(channels) == 1 else triads.pop() if len(triads) == 1 else ""
    # A bias that the turns add up to (cable wrap) is a slow change of it, too.
    slow = effect.bias_drift or (effect.wander_like and effect.shifts_bias)
    family = f"{sensor[:-2]}{BIAS_DRIFT}" if slow and len(channels) == 1 else candidate.family
    return family, f"{sensor} in {candidate.recording}".strip() if candidate.recording else sensor
