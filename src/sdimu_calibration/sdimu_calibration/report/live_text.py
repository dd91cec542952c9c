"""A live diagnosis in words: names of models, sizes of candidates, the ladder, one line for a log."""

from __future__ import annotations

from collections.abc import Sequence

from sdimu_calibration.core.diagnosis.live_diagnosis import WAITING, LiveDiagnosis, ModelError, Ranked
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.table import with_sigma

AS_GIVEN = "as given"
_NAMED = 2
"""Number of candidates that a line names."""


def model_name(added: Sequence[str]) -> str:
    """Name a model by what was added to it."""
    return " ".join(f"+ {effect}" for effect in added) or AS_GIVEN


def size(candidate: Ranked) -> str:
    """Write the estimate of a candidate and its sigma, in its customary unit."""
    factor, unit = from_si(1.0, candidate.display_unit), candidate.display_unit
    return with_sigma(candidate.estimate * factor, candidate.sigma * factor, unit)


def best_ranked(ranking: Sequence[Ranked]) -> list[Ranked]:
    """Those with a score, one a parameter: the best of the onsets or time constants that were tried."""
    best: dict[str, Ranked] = {}
    for candidate in ranking:
        best.setdefault(candidate.label.partition("(")[0], candidate)
    return list(best.values())


def ladder_rows(ladder: Sequence[ModelError]) -> list[tuple[str, str]]:
    """Name each model and write its error at stops held out."""
    return [(model_name(rung.added), f"{rung.held_out:.4g}") for rung in ladder]


def told(found: LiveDiagnosis) -> str:
    """Say a diagnosis in one line: the verdict, what stands out, how far the error fell."""
    if found.verdict == WAITING:
        return f"stop {found.stop}: {found.sentence}"
    named = ", ".join(f"{r.label} {r.z:+.1f}" for r in best_ranked(found.standing)[:_NAMED])
    above = f" ({named}; noise reaches {found.threshold:.1f})" if named else ""
    errors = ", ".join(f"{name} {error}" for name, error in ladder_rows(found.ladder))
    return f"stop {found.stop}: {found.verdict}{above}; error at stops held out: {errors}"
