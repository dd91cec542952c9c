"""What people and files read of a diagnosis."""

from __future__ import annotations

from dataclasses import dataclass

from sdimu_calibration.core.advice import Advice
from sdimu_calibration.core.diagnosis.advice import (
    Untestable,
    advice,
    handheld_advice,
    untestable_by_hand,
    untestable_reasons,
)
from sdimu_calibration.core.diagnosis.assumed import Assumed, assumed_absent
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.found import DetectableSize, Found, reach
from sdimu_calibration.core.diagnosis.plan_seen import PlanSeen, plan_seen
from sdimu_calibration.core.evidence.navigation_evidence import NavigationEvidence
from sdimu_calibration.core.verdict import Verdict


@dataclass(frozen=True)
class DiagnosisSummary:
    """What people and files read of a diagnosis."""

    diagnosis: Diagnosis
    found: tuple[Found, ...]
    """Chosen effects; when the verdict is ``unexplained`` they are what was tried, not what was found."""
    reached: tuple[DetectableSize, ...]
    """Smallest detectable size of every candidate."""
    plan: PlanSeen | None
    """Turns and stops of the table; None for a handheld run."""
    untestable: tuple[Untestable, ...]
    """What could not have been seen, by reason."""
    advice: tuple[Advice, ...]
    assumed: tuple[Assumed, ...] = ()
    """What would move a coefficient most, if it were there after all."""

    @property
    def candidates(self) -> tuple[Found, ...]:
        """What counts as found, best first."""
        if self.diagnosis.verdict == Verdict.UNEXPLAINED:
            return ()
        return tuple(sorted(self.found, key=lambda f: -f.log_likelihood_gain))


def summarise(d: Diagnosis) -> DiagnosisSummary:
    """Work out what a diagnosis has to say."""
    found, reached = d.found_effects, reach(d)
    if not isinstance(d.evidence, NavigationEvidence):
        told = handheld_advice(d, found)
        return DiagnosisSummary(d, found, reached, None, untestable_by_hand(reached), told, assumed_absent(d))
    plan = plan_seen(d.evidence)
    reasons, told = untestable_reasons(reached, plan), advice(d, found, reached, plan)
    return DiagnosisSummary(d, found, reached, plan, reasons, told, assumed_absent(d))
