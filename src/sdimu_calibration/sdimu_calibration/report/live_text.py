"""A live diagnosis in words: names of models, sizes of candidates, the ladder, one line for a log."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.live_diagnosis import LiveDiagnosis, ModelError, Ranked
from sdimu_calibration.core.units import from_si
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.report.table import with_sigma

Rows = tuple[tuple[str, str], ...]

AS_GIVEN = "as given"
_QUIET = frozenset({Verdict.CONSISTENT, Verdict.WAITING})
"""Verdicts beside which no candidate is named."""
_UNSEEN = 1e5
"""Sigma (customary unit) from which a size is not told: a tenth of g or of a scale factor says that the turns so far do
not show it."""
_NAMED = 2
"""Number of candidates that a line names."""


@dataclass(frozen=True)
class SeenFamily:
    """A family of effects, its probability, and that of each of its members, by label."""

    name: str
    probability: float
    members: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True)
class SeenChoice:
    """A choice of a test that chooses its turns."""

    text: str
    """Move and reason, or why the test ends."""
    minutes: float
    """Of the test, when it was made."""
    worst: float
    """Largest sigma over its limit (1)."""


@dataclass(frozen=True)
class SeenDiagnosis:
    """A live diagnosis as its topics tell it."""

    stop: int = -1
    verdict: str = ""
    sentence: str = ""
    reaches: str = ""
    """Size of the score that noise reaches, in words."""
    ranking: Rows = ()
    ladder: Rows = ()
    """`ranking`, `ladder`: candidates and their scores; models and their errors."""
    channels: tuple[str, ...] = ()
    """Length c."""
    stops: tuple[str, ...] = ()
    """Length s."""
    heat: Floats = field(default_factory=lambda: np.empty((0, 0)))
    """Mean innovation over its sigma, shape (c, s)."""
    nothing: float = math.nan
    """Probability that no effect is missing; NaN before the test has ended."""
    families: tuple[SeenFamily, ...] = ()
    """The likeliest first; none before the test has ended."""
    standing: int = 0
    """Number of candidates that stand out of the noise: the first of `ranking`."""

    @property
    def line(self) -> str:
        """The whole of it in one line, but for the heat map."""
        named = ", ".join(f"{label} {score}" for label, score in self.ranking[:_NAMED])
        errors = ", ".join(f"{name} {error}" for name, error in self.ladder)
        parts = (
            f"diagnosis of stop {self.stop}: {self.verdict}: {self.sentence}",
            f"{named} ({self.reaches})" if named and self.verdict not in _QUIET else "",
            f"error with one stop left out: {errors}" if errors else "",
        )
        return "; ".join(part.rstrip(".") for part in parts if part)


def model_name(added: Sequence[str]) -> str:
    """Name a model by what was added to it."""
    return " ".join(f"+ {effect}" for effect in added) or AS_GIVEN


def size(candidate: Ranked) -> str:
    """Write the estimate of a candidate and its sigma, in its customary unit."""
    factor, unit = from_si(1.0, candidate.display_unit), candidate.display_unit
    if not abs(candidate.sigma * factor) < _UNSEEN:
        return "size not seen yet"
    return with_sigma(candidate.estimate * factor, candidate.sigma * factor, unit)


def best_ranked(ranking: Sequence[Ranked]) -> list[Ranked]:
    """Those with a score, one a parameter: the best of the onsets or time constants that were tried."""
    best: dict[str, Ranked] = {}
    for candidate in ranking:
        best.setdefault(candidate.label.partition("(")[0], candidate)
    return list(best.values())


def ladder_rows(ladder: Sequence[ModelError]) -> list[tuple[str, str]]:
    """Name each model and write its error with one stop left out, which needs two stops."""
    known = "{:.4g}".format
    return [
        (model_name(rung.added), known(rung.held_out) if math.isfinite(rung.held_out) else "not yet") for rung in ladder
    ]


def diagnosis_line(found: LiveDiagnosis) -> str:
    """Say a diagnosis in one line: the verdict, what stands out, how far the error fell."""
    if found.verdict == Verdict.WAITING:
        return f"stop {found.stop}: {found.sentence}"
    named = ", ".join(f"{r.label} {r.z:+.1f}" for r in best_ranked(found.standing)[:_NAMED])
    above = f" ({named}; noise reaches {found.threshold:.1f})" if named else ""
    errors = ", ".join(f"{name} {error}" for name, error in ladder_rows(found.ladder))
    return f"stop {found.stop}: {found.verdict}{above}; error with one stop left out: {errors}"
