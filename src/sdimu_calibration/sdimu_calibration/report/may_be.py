"""What each effect that was found may be, and how probable that is, in the numbers of the verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from sdimu_calibration.core.diagnosis.found import Found
from sdimu_calibration.core.diagnosis.grades import graded, percents_of
from sdimu_calibration.core.posterior.told import Probabilities
from sdimu_calibration.core.probability import in_percent


@dataclass(frozen=True)
class MayBe:
    """What an effect that was found may be."""

    probability: str = ""
    """That one of these is missing, in words; empty where no probabilities were worked out."""
    shares: Mapping[str, str] = field(default_factory=dict)
    """Coefficients, itself first, each with its probability in words; none where it is told which it is."""


def classes_of(found: Sequence[Found], told: Probabilities | None = None) -> dict[str, MayBe]:
    """Say what each coefficient that was found may be: its class, or its family where the verdict names that.

    `told`: with the probabilities of the families.
    """
    out = {}
    for one, grade in zip(found, graded(found, told), strict=True):
        own = one.candidate.coefficient
        every = {share.name: share for share in (*one.may_be, *grade.may_be)}
        shares = percents_of(every.values())
        probability = in_percent(grade.probability) if grade.probability == grade.probability else ""
        out[own] = MayBe(probability, {own: in_percent(0.0)} | shares if set(shares) - {own} else {})
    return out
